"""Places with parts that look alike, where a scan fits more than one pose."""

from __future__ import annotations

from slamreplay.simulate.worlds import Solid, World, box, disc, room_walls

#: From one bay to the next along y, m; a whole number of map cells, so that their maps are equal.
BAY_PITCH_M = 6.0
#: The bays end, and the passage before them begins, at this x, m.
BAY_LENGTH_M = 16.0
_BAY_DEPTH_M, _PASSAGE_M = 5.0, 5.0


def twin_bays() -> World:
    """Two storage bays of 16 m x 5 m that are equal to the last cell, and a passage before both.

    The lower bay lies at y from 0 to 5 m, the upper one 6 m above it. Only from the passage can a
    robot tell them apart: there it has the end of the hall on its right or on its left.
    """
    bounds = (0.0, 0.0, BAY_LENGTH_M + _PASSAGE_M, BAY_PITCH_M + _BAY_DEPTH_M)
    between = box("between the bays", 0.0, _BAY_DEPTH_M, BAY_LENGTH_M, BAY_PITCH_M - _BAY_DEPTH_M)
    bays = [piece for k in (0, 1) for piece in _bay(k, k * BAY_PITCH_M)]
    # The same before either bay, so that looking out of it tells nothing.
    passage = [box(f"bench {k}", bounds[2] - 0.6, 1.4 + k * BAY_PITCH_M, 0.6, 1.5) for k in (0, 1)]
    return World(bounds, (*room_walls("wall", bounds), between, *bays, *passage))


def _bay(k: int, y: float) -> list[Solid]:
    """What stands in a bay: nothing in it repeats along the bay."""
    return [
        box(f"rack {k}.1", 1.6, y + 0.0, 3.1, 0.9),
        box(f"rack {k}.2", 6.3, y + 0.0, 2.2, 0.9),
        box(f"rack {k}.3", 10.0, y + 0.0, 4.3, 0.9),
        box(f"shelf {k}.1", 0.8, y + 4.2, 4.6, 0.8),
        box(f"shelf {k}.2", 7.7, y + 4.2, 3.4, 0.8),
        box(f"shelf {k}.3", 12.9, y + 4.2, 1.7, 0.8),
        disc(f"pillar {k}", 9.1, y + 1.3, 0.2),
        box(f"cupboard {k}", 0.0, y + 1.6, 0.4, 1.2),
    ]
