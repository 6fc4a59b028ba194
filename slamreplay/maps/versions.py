"""Versions of a map beside each other: how much changed, and whether it is still one place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.maps.grid import FREE_TO, OCCUPIED_FROM, OccupancyGrid

#: A wall is still there if one of the other version is this near, m.
NEAR_M = 0.25
#: Versions of which no more of the faces than this stands otherwise are of one place. Of two floors
#: that share their outer walls a third does, and a robot placed in the wrong one would be called
#: lost; to judge two versions apart costs no more than the evidence across the switch.
OTHERWISE = 0.2
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
    """Whether a robot that drives by the old map can be looked for in the new one.

    They are in one frame, nearly all faces of the old one's walls are still there, and hardly any
    new one stands where the old one is free. What it was silent about does not count: a map that
    is being drawn grows.
    """
    if old.frame_id != new.frame_id:
        return False
    before, now = _faces(old), _faces(new)
    gone = before[~_has_wall(new, old.centre_of(before))]
    fresh = now[~_has_wall(old, new.centre_of(now))]
    cell = old.cell_of(new.centre_of(fresh))
    inside = cell[old.inside(cell)]
    added = np.count_nonzero(old.free[tuple(inside.T)])
    return bool(len(gone) + added <= OTHERWISE * (len(before) + added))


def _faces(grid: OccupancyGrid) -> NDArray[np.int64]:
    """(N, 2) wall cells beside free ones: thick walls count by what can be seen of them."""
    return np.argwhere(grid.occupied & _largest_near(grid.free, 3))


def _has_wall(grid: OccupancyGrid, xy_m: se2.Array) -> NDArray[np.bool_]:
    """(N,) which points (N, 2) have a wall within `NEAR_M` to both sides of them, rows and columns.

    Outside of the grid none has.
    """
    found = np.zeros(len(xy_m), dtype=bool)
    # A square filter takes a third of the time of a distance transform.
    near = _largest_near(grid.occupied, 2 * round(NEAR_M / grid.resolution_m) + 1)
    cell = grid.cell_of(xy_m)
    inside = grid.inside(cell)
    found[inside] = near[tuple(cell[inside].T)]
    return found


def _largest_near(cells: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """Cells with a true one in the square of `size` cells around them."""
    from scipy.ndimage import maximum_filter  # takes longer to load than most logs to ingest

    return np.asarray(maximum_filter(cells, size))
