"""Rounds through a corridor that repeats itself, and through a common one."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from slamreplay.simulate.corridors import repetitive_ring
from slamreplay.simulate.drive import Follow, Pause
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import WheelErrors
from slamreplay.simulate.worlds import World, office

#: From the outer wall to the middle of the corridor, m.
_MIDDLE_M = 1.0
#: The wheels of the 100 m round through the office.
_WHEELS = WheelErrors(scale=0.006, turn_scale=0.009, pull=0.0015)

CORRIDORS: Mapping[str, Callable[[], World]] = {"common": office, "repetitive": repetitive_ring}


def round_trip(corridor: str, again_m: float, seed: int) -> Scenario:
    """Once round a ring from the middle of its long side, on to the next corner, and further.

    Args:
        corridor: one of `CORRIDORS`.
        again_m: how far beyond that corner what was seen at first is driven again.
        seed: of the log.
    """
    world = CORRIDORS[corridor]()
    x0, y0, x1, y1 = world.bounds
    low_x, low_y, high_x, high_y = (
        x0 + _MIDDLE_M, y0 + _MIDDLE_M, x1 - _MIDDLE_M, y1 - _MIDDLE_M,
    )  # fmt: skip
    way = (
        (high_x, low_y), (high_x, high_y), (low_x, high_y), (low_x, low_y), (high_x, low_y),
        (high_x, low_y + again_m),
    )  # fmt: skip
    tour = (Pause(1.0), Follow(way, speed=0.95), Pause(1.0))
    start = (0.5 * (x0 + x1), low_y, 0.0)
    return Scenario(world, world, start, tour, "healthy", seed, wheels=_WHEELS)
