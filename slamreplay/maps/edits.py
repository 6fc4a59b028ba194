"""Maps with walls taken off, drawn or drawn elsewhere, so that they contradict what was seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.maps.grid import FREE, OCCUPIED, OccupancyGrid

#: Unknown cells this near to walls that were taken off the map become free with them.
CLEARED_M = 0.5


def without_walls(grid: OccupancyGrid, walls: NDArray[np.int64]) -> OccupancyGrid:
    """The map without these walls: what stands there has appeared since it was drawn.

    Unknown cells within half a metre of them become free too: a wall at the edge of the unknown
    would contradict no map that merely ends there.

    Args:
        grid: the map.
        walls: (N, 2) row and column of cells of it.
    """
    return _with_cells(grid, _cleared(grid, walls))


def with_walls(grid: OccupancyGrid, cells: NDArray[np.int64]) -> OccupancyGrid:
    """The map with walls in these cells (N, 2): what stood there has been removed since."""
    edited = grid.cells.copy()
    edited[cells[:, 0], cells[:, 1]] = OCCUPIED
    return _with_cells(grid, edited)


def with_walls_moved(
    grid: OccupancyGrid, walls: NDArray[np.int64], shift_xy_m: ArrayLike
) -> tuple[OccupancyGrid, NDArray[np.int64]]:
    """The map with these walls drawn elsewhere: they have moved back since.

    Args:
        grid: the map.
        walls: (N, 2) cells of it.
        shift_xy_m: (2,) from where they are to where they are drawn, in the map frame.

    Returns:
        The map, and the cells (M, 2) they are drawn in: what would leave the map is not drawn.
    """
    target = grid.cell_of(grid.centre_of(walls) + np.asarray(shift_xy_m, dtype=np.float64))
    target = target[grid.inside(target)]
    cells = _cleared(grid, walls)
    cells[target[:, 0], target[:, 1]] = OCCUPIED
    return _with_cells(grid, cells), target


def _cleared(grid: OccupancyGrid, walls: NDArray[np.int64]) -> NDArray[np.int8]:
    """Cells without these walls, known to be free about where they were."""
    from scipy.ndimage import distance_transform_edt

    cells = grid.cells.copy()
    if not len(walls):
        return cells
    reach = int(CLEARED_M / grid.resolution_m) + 1  # nothing farther off is touched
    low = np.maximum(walls.min(axis=0) - reach, 0)
    high = walls.max(axis=0) + reach + 1
    part = cells[low[0] : high[0], low[1] : high[1]]
    far = np.ones(part.shape, dtype=bool)
    far[walls[:, 0] - low[0], walls[:, 1] - low[1]] = False
    near = distance_transform_edt(far) * grid.resolution_m <= CLEARED_M
    part[near & (part < 0)] = FREE
    cells[walls[:, 0], walls[:, 1]] = FREE
    return cells


def _with_cells(grid: OccupancyGrid, cells: NDArray[np.int8]) -> OccupancyGrid:
    return OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)
