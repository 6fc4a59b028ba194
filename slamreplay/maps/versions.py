"""Versions of a map beside each other: how much changed, and whether it is still one place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from slamreplay.geometry import se2
from slamreplay.maps.grid import FREE_TO, OCCUPIED_FROM, OccupancyGrid

#: A wall is still there if one of the other version is this near, m.
NEAR_M = 0.25
#: Versions of which so much of the walls is still there are of one place: half an aisle may be laid
#: out anew. Of walls of an unrelated map less than a third lie this near to any other.
SAME_SHARE = 0.6
_KINDS: NDArray[np.uint8] = np.select(
    [np.arange(256) > 127, np.arange(256) >= OCCUPIED_FROM, np.arange(256) <= FREE_TO], [0, 1, 2], 3
).astype(np.uint8)


def changed_cells(old: OccupancyGrid, new: OccupancyGrid) -> int:
    """How many cells became a wall, free, unknown or doubtful that were something else.

    Cells that only one of them has count if they are known. Of grids in other frames, turned or of
    another resolution, all known cells of both count.
    """
    shift = _shift(old, new)
    a, b = _KINDS[old.cells.view(np.uint8)], _KINDS[new.cells.view(np.uint8)]
    known = int(np.count_nonzero(a)) + int(np.count_nonzero(b))
    if shift is None:
        return known
    low = np.maximum(shift, 0)
    high = np.minimum(shift + new.cells.shape, old.cells.shape)
    if (high <= low).any():
        return known
    in_old = a[low[0] : high[0], low[1] : high[1]]
    in_new = b[low[0] - shift[0] : high[0] - shift[0], low[1] - shift[1] : high[1] - shift[1]]
    outside = known - int(np.count_nonzero(in_old)) - int(np.count_nonzero(in_new))
    return outside + int(np.count_nonzero(in_old != in_new))


def _shift(old: OccupancyGrid, new: OccupancyGrid) -> NDArray[np.int64] | None:
    """(2,) row and column of the new grid's first cell in the old one; None of other lattices."""
    if old.frame_id != new.frame_id or not np.isclose(old.resolution_m, new.resolution_m, 1e-4):
        return None
    step = se2.between(old.origin_xyyaw, new.origin_xyyaw)
    if abs(float(step[2])) * max(new.cells.shape) > 0.5:
        return None
    return np.rint(step[1::-1] / old.resolution_m).astype(np.int64)


def same_place(old: OccupancyGrid, new: OccupancyGrid) -> bool:
    """Whether a robot in the old map can be found in the new one.

    They are in one frame, and most walls of the old one are still there. What the new one has
    beside them does not count: a map that is being drawn grows.
    """
    if old.frame_id != new.frame_id:
        return False
    walls = np.argwhere(old.occupied)
    if not len(walls):
        return True
    if not new.occupied.any():
        return False
    away_m = distance_transform_edt(~new.occupied) * new.resolution_m
    cell = new.cell_of(old.centre_of(walls))
    inside = new.inside(cell)
    still = away_m[tuple(cell[inside].T)] <= NEAR_M
    return bool(np.count_nonzero(still) >= SAME_SHARE * len(walls))
