"""Rings of corridors: one in which everything repeats itself, and rounds to drive through them."""

from __future__ import annotations

from slamreplay.simulate.worlds import Solid, World, box, room_walls

#: From one door to the next, m, a whole number of map cells.
PITCH_M = 4.0
_CORRIDOR_M, _SIDES_M = 2.0, (38.0, 18.0)
_JAMB_M, _DEEP_M = 0.3, 0.25


def repetitive_ring() -> World:
    """A ring of corridors, 2 m wide, 104 m along its middle line, in which nothing is unique.

    A door's jambs stand out of either wall every 4 m, all of one size; there is nothing else, and
    the ring looks the same turned by half a turn.
    """
    bounds = (0.0, 0.0, *_SIDES_M)
    x0, y0 = _CORRIDOR_M, _CORRIDOR_M
    x1, y1 = bounds[2] - x0, bounds[3] - y0
    solids: list[Solid] = [*room_walls("wall", bounds), box("block", x0, y0, x1 - x0, y1 - y0)]
    for k in range(int((x1 - x0) / PITCH_M)):
        at = x0 + 0.5 * (x1 - x0 - PITCH_M * (int((x1 - x0) / PITCH_M) - 1)) + k * PITCH_M
        for name, y in (("south", 0.0), ("north", bounds[3] - _DEEP_M)):
            solids.append(box(f"jamb {name} {k}", at - 0.5 * _JAMB_M, y, _JAMB_M, _DEEP_M))
    for k in range(int((y1 - y0) / PITCH_M)):
        at = y0 + 0.5 * (y1 - y0 - PITCH_M * (int((y1 - y0) / PITCH_M) - 1)) + k * PITCH_M
        for name, x in (("west", 0.0), ("east", bounds[2] - _DEEP_M)):
            solids.append(box(f"jamb {name} {k}", x, at - 0.5 * _JAMB_M, _DEEP_M, _JAMB_M))
    return World(bounds, tuple(solids))
