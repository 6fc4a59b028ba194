"""What happens in each scenario: where, along which tour, with which fault, and what that is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slamreplay.errors import UsageError
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.simulate import SCENARIOS
from slamreplay.simulate.codes import CodeFloor
from slamreplay.simulate.drive import BackUp, Carry, Follow, Pause, Slip, Spin, Step
from slamreplay.simulate.people import Walker
from slamreplay.simulate.sensors import Lidar, WheelErrors
from slamreplay.simulate.worlds import (
    MAP_RESOLUTION_M,
    TRUE_RESOLUTION_M,
    World,
    box,
    drive_hall,
    office,
    warehouse,
)

#: Stamps start here: a fixed time, for a log must not depend on when it was made.
START_NS = 1_750_000_000 * NS_PER_S


@dataclass(frozen=True)
class Scenario:
    """One story.

    Attributes:
        mapped: the world the map was drawn from.
        standing: the world as it is.
        start: true pose at the start, x y yaw in the map frame.
        tour: what the robot does.
        verdict: the state that the definitions of the report give it, computed from the truth.
        seed: the one used unless another is asked for.
        believed_start: the pose somebody clicked; the true one if None.
        start_sigmas: (3,) how well the start is said to be known, m, m, rad; as clicked if None.
        walkers: the people.
        lidar: the range finder.
        wheels: how wrong the odometry is.
        rear: a second laser that looks back, None where there is one only.
        amcl: parameters of the localizer on board.
        map_resolution_m: edge of a map cell.
        true_resolution_m: edge of a cell of what beams really meet.
        scan_late_s: stamps of scans are late by this: they name a moment after the sweep.
        odometry_late_s: the same of odometry and its tf.
        no_scans: stretches (from, to) in s in which no scan was recorded nor seen.
        without: what the robot does not have or publish: "odometry", "tf", "laser" (nor, then, a
            localizer).
        floor: codes in the floor that the robot reads from above.
        logged: the world the map in the log was drawn from, where it is not the robot's own.
        xyyaw_logged_map: (3) the robot's map frame in the frame of the map in the log.
        true_odometry_s: stretches (from, to) in s in which odometry tells the motion as it was,
            whatever the wheels did: what a slip or a carry would have been without its fault.
        start_ns: the robot's clock when the log begins.
    """

    mapped: World
    standing: World
    start: tuple[float, float, float]
    tour: tuple[Step, ...]
    verdict: str
    seed: int
    believed_start: tuple[float, float, float] | None = None
    walkers: tuple[Walker, ...] = ()
    lidar: Lidar = field(default_factory=Lidar)
    wheels: WheelErrors = field(default_factory=WheelErrors)
    rear: Lidar | None = None
    amcl: AmclConfig = field(default_factory=AmclConfig)
    map_resolution_m: float = MAP_RESOLUTION_M
    true_resolution_m: float = TRUE_RESOLUTION_M
    scan_late_s: float = 0.0
    odometry_late_s: float = 0.0
    no_scans: tuple[tuple[float, float], ...] = ()
    without: frozenset[str] = frozenset()
    floor: CodeFloor | None = None
    logged: World | None = None
    xyyaw_logged_map: tuple[float, float, float] = (0.0, 0.0, 0.0)
    start_sigmas: tuple[float, float, float] | None = None
    true_odometry_s: tuple[tuple[float, float], ...] = ()
    start_ns: int = START_NS

    @property
    def start_cov(self) -> se2.Array:
        """(3, 3) what is sent with the first pose."""
        return CLICKED_COV if self.start_sigmas is None else np.diag(self.start_sigmas) ** 2


#: What rviz sends with a clicked pose: 0.5 m, 0.5 m, 15 deg.
CLICKED_COV: se2.Array = np.diag([0.25, 0.25, (np.pi / 12.0) ** 2])

_START = (1.5, 1.3, 0.0)
_FIRST_GOAL = ((15.3, 1.2), (15.3, 4.6), (9.0, 4.6))
_SECOND_GOAL = ((3.2, 4.6), (1.5, 4.9), (1.5, 8.0), (7.7, 8.0))
_THIRD_GOAL = ((15.8, 8.0), (19.0, 8.8))
_ROUND = (
    Pause(2.0),
    Follow(_FIRST_GOAL),
    Pause(2.0),
    Follow(_SECOND_GOAL),
    Pause(2.0),
    Follow(_THIRD_GOAL),
    Pause(1.5),
)
#: Nav2's recoveries in their round-robin order; clearing the costmap takes no time.
_RECOVERIES = (Pause(0.3, "ClearLocalCostmap-Context"), Spin(1.57), Pause(5.0, "Wait"), BackUp())

_PASSER_BY = Walker(((16.5, 1.0), (16.9, 8.2), (22.0, 9.6)), 1.0)


def scenario(name: str) -> Scenario:
    """The scenario of that name.

    Raises:
        UsageError: there is none.
    """
    if name not in SCENARIOS:
        raise UsageError(
            f"there is no scenario '{name}'", hint=f"there are: {', '.join(SCENARIOS)}"
        )
    made: Scenario = globals()[f"_{name}"]()
    return made


def _healthy() -> Scenario:
    hall = warehouse()
    return Scenario(hall, hall, _START, _ROUND, "healthy", 1, walkers=(_PASSER_BY,))


def _healthy_short() -> Scenario:
    hall = warehouse()
    tour = (Pause(1.0), Follow(((13.6, 1.2),)), Pause(1.5))
    return Scenario(hall, hall, _START, tour, "healthy", 2)


def _people() -> Scenario:
    hall = warehouse()
    crowd = (
        _PASSER_BY,
        Walker(((14.0, 0.9), (2.0, 1.9)), 0.9),
        Walker(((1.2, 2.2), (1.0, 12.5)), 1.2),
        Walker(((2.2, 4.0), (15.8, 5.2)), 1.0, 5.0),
        Walker(((2.4, 7.4), (17.0, 8.6)), 1.1, 9.0),
        Walker(((8.5, 4.8), (8.5, 7.9)), 0.8),
        Walker(((17.6, 2.9), (21.0, 9.8)), 1.2, 3.0),
    )
    return Scenario(hall, hall, _START, _ROUND, "healthy", 3, walkers=crowd)


def _lost_robot() -> Scenario:
    hall = warehouse()
    tour = (
        Pause(2.0),
        Follow(((12.2, 1.2),), beyond=_FIRST_GOAL),
        *_RECOVERIES,
        Follow(((15.3, 1.2), (15.3, 4.6), (12.6, 4.6)), beyond=_FIRST_GOAL[-1:]),
        *_RECOVERIES[:3],
        Follow(((7.4, 4.6),)),
        Pause(2.0),
    )
    return Scenario(
        hall, hall, _START, tour, "lost", 4, believed_start=(1.9, 7.9, 0.3), walkers=(_PASSER_BY,)
    )


def _wheel_slip() -> Scenario:
    hall = warehouse()
    slip = Slip(from_m=18.6, duration_s=5.0, grip=0.1, yaw_rate=0.07)
    tour = (
        Pause(2.0),
        Follow((*_FIRST_GOAL[:2], (7.2, 4.6)), slip=slip, beyond=_SECOND_GOAL[:1]),
        *_RECOVERIES,
        Follow(_SECOND_GOAL),
        Pause(2.0),
    )
    return Scenario(hall, hall, _START, tour, "lost", 5)


def _kidnapped() -> Scenario:
    hall = warehouse()
    tour = (
        Pause(2.0),
        Follow((*_FIRST_GOAL[:2], (8.5, 4.6))),
        Pause(3.0),
        Carry((8.5, 8.0, 0.4)),
        Pause(2.0),
        Follow(((15.2, 8.0),), beyond=((17.0, 8.0),)),
        *_RECOVERIES,
        Follow(((19.4, 8.8), (21.8, 8.0))),
        Pause(2.0),
    )
    return Scenario(hall, hall, _START, tour, "lost", 6)


def _rearranged() -> World:
    """The warehouse with a blocked aisle, pallets in the open and a rack that was taken down."""
    return warehouse().changed(
        without=("rack a2",),
        added=(
            box("pallets in the aisle", 6.1, 3.6, 1.0, 2.0),
            box("pallet", 17.3, 6.1, 1.2, 0.8, 0.3),
            box("rack d", 9.4, 11.9, 4.2, 0.9),
        ),
    )


_DETOUR = (
    Pause(2.0),
    Follow((*_FIRST_GOAL[:2], (8.4, 4.6)), beyond=_SECOND_GOAL),
    *_RECOVERIES,
    Follow(((15.2, 4.7), (15.3, 8.0), (8.0, 8.0))),
    Pause(2.0),
)


def _changed_aisle() -> Scenario:
    return Scenario(warehouse(), _rearranged(), _START, _DETOUR, "map_changed", 7)


def _lost_in_changed_aisle() -> Scenario:
    return Scenario(
        warehouse(),
        _rearranged(),
        _START,
        _DETOUR,
        "lost_and_map_changed",
        8,
        believed_start=(2.3, 8.2, -0.25),
    )


def _corridor_100m() -> Scenario:
    floor = office()
    ring = ((34.95, 1.0), (34.95, 17.2), (1.0, 17.2), (1.0, 1.0), (18.0, 1.0))
    tour = (Pause(2.0), Follow(ring, speed=0.95), Pause(2.0))
    wheels = WheelErrors(scale=0.006, turn_scale=0.009, pull=0.0015)
    return Scenario(floor, floor, (18.0, 1.0, 0.0), tour, "healthy", 9, wheels=wheels)


#: Rounds along the lattice: a drive unit turns on a code, never between two.
_LATTICE_ROUND = (
    (8.0, 2.0), (8.0, 5.0), (3.0, 5.0), (3.0, 8.0), (11.0, 8.0), (11.0, 3.0), (6.0, 3.0),
    (6.0, 9.0), (1.0, 9.0), (1.0, 2.0),
)  # fmt: skip


def _barcode_floor() -> Scenario:
    hall = drive_hall()
    floor = CodeFloor((1.0, 1.0), 12, 9, hidden=((40.0, 55.0),))
    legs = tuple(Follow((corner,)) for corner in _LATTICE_ROUND)
    return Scenario(
        hall,
        hall,
        (1.0, 2.0, 0.0),
        (Pause(2.0), *legs, Pause(1.0)),
        "insufficient_data",
        10,
        without=frozenset({"laser"}),
        floor=floor,
    )
