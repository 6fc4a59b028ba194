"""One drive, and the worlds it is driven in: each differs from the healthy one in one thing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from slamreplay.simulate.drive import Carry, Follow, Pause, Slip, Step
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.worlds import Solid, World, box, warehouse

_START = (1.5, 1.3, 0.0)
#: Along the first aisle, round its end, and back through the second one.
_WAY = ((15.3, 1.2), (15.3, 4.6), (3.2, 4.6))
#: Where the robot is lifted, and where the wheels begin to slip, in the second aisle.
_LIFTED, _SLIPS_FROM_M = (11.0, 4.6), 20.0
_GRIP, _SLIP_RAD_S = 0.1, 0.07
#: Of the world with both, m: in the third aisle.
FAR_START_M = 6.7
_BOX_M = (0.8, 0.5)
#: Lower left corners of the places for boxes, all beside the way and 0.6 m or more off it.
_BOX_PLACES = (
    (3.4, 1.88), (5.2, 1.88), (7.2, 1.88), (10.3, 1.88), (11.9, 1.88),
    (2.6, 0.02), (7.4, 0.02), (9.6, 0.02), (13.2, 0.02),
    (4.0, 3.42), (6.3, 3.42), (10.2, 3.42), (4.8, 5.28), (6.6, 5.28), (9.6, 5.28), (12.2, 5.28),
)  # fmt: skip
#: The racks beside the way.
_RACKS = ("rack a1", "rack a2", "rack b1", "rack b2")


def healthy() -> Scenario:
    """The drive of which all others are copies but for one thing."""
    hall = warehouse()
    return Scenario(hall, hall, _START, (Pause(2.0), Follow(_WAY), Pause(2.0)), "", 0)


def _wrong_start(story: Scenario, off_m: float, _: np.random.Generator) -> Scenario:
    """Somebody clicks so far across the aisles."""
    x, y, yaw = story.start
    return replace(story, believed_start=(x, y + off_m, yaw))


def _slip(story: Scenario, for_s: float, rng: np.random.Generator) -> Scenario:
    """The wheels slip for so long, and the robot turns a little meanwhile."""
    slip = Slip(_SLIPS_FROM_M, for_s, _GRIP, float(rng.choice([-1.0, 1.0])) * _SLIP_RAD_S)
    return replace(story, tour=(Pause(2.0), Follow(_WAY, slip=slip), Pause(2.0)))


def _carried(story: Scenario, far_m: float, _: np.random.Generator) -> Scenario:
    """Somebody lifts it and puts it down so far along its own way."""
    x, y = _LIFTED
    tour: tuple[Step, ...] = (
        Pause(2.0),
        Follow((*_WAY[:2], _LIFTED)),
        Carry((x - far_m, y, np.pi), duration_s=4.0),
        Follow(_WAY[2:]),
        Pause(2.0),
    )
    return replace(story, tour=tour)


def _boxes(story: Scenario, n: float, rng: np.random.Generator) -> Scenario:
    """So many boxes were put down beside the way."""
    places = rng.permutation(len(_BOX_PLACES))[: round(n)]
    added = [box(f"box {k}", *_BOX_PLACES[k], *_BOX_M) for k in places]
    return replace(story, standing=story.standing.changed(added=added))


def _racks_removed(story: Scenario, n: float, rng: np.random.Generator) -> Scenario:
    """So many racks beside the way were taken away."""
    gone = [_RACKS[k] for k in rng.permutation(len(_RACKS))[: round(n)]]
    return replace(story, standing=story.standing.changed(without=gone))


def _racks_moved(story: Scenario, by_m: float, rng: np.random.Generator) -> Scenario:
    """Each rack beside the way was moved by so much, in a direction of its own."""
    angles = rng.uniform(-np.pi, np.pi, len(_RACKS))
    moved = [
        _moved(story.standing, name, by_m * np.cos(angle), by_m * np.sin(angle))
        for name, angle in zip(_RACKS, angles, strict=True)
    ]
    return replace(story, standing=story.standing.changed(without=_RACKS, added=moved))


def _moved(world: World, name: str, dx: float, dy: float) -> Solid:
    (solid,) = (s for s in world.solids if s.name == name)
    return Solid(f"{name}, moved", tuple((x + dx, y + dy) for x, y in solid.corners))


def _wrong_start_and_boxes(story: Scenario, n: float, rng: np.random.Generator) -> Scenario:
    """So many boxes, and a pose that was clicked two aisles off."""
    return _boxes(_wrong_start(story, FAR_START_M, rng), n, rng)


#: What may differ, with its unit in the name: how much, drawn by the log's own generator.
DIFFERENCES: dict[str, Callable[[Scenario, float, np.random.Generator], Scenario]] = {
    "wrong_start_m": _wrong_start,
    "slip_s": _slip,
    "carried_m": _carried,
    "boxes": _boxes,
    "racks_removed": _racks_removed,
    "racks_moved_m": _racks_moved,
    "boxes_and_wrong_start": _wrong_start_and_boxes,
}
#: The most boxes and racks there are.
BOXES, RACKS = len(_BOX_PLACES), len(_RACKS)


def with_one_difference(story: Scenario, what: str, level: float, seed: int) -> Scenario:
    """The drive with so much of one thing; more of it is the same and more, seed by seed."""
    rng = np.random.Generator(np.random.PCG64([seed, list(DIFFERENCES).index(what)]))
    return DIFFERENCES[what](story, level, rng)
