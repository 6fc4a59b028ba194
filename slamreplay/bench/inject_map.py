"""Maps edited against a recorded log, so that what stands there has appeared, gone or moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.bench.injection import Box, Injection
from slamreplay.bundle.view import BundleView
from slamreplay.errors import UsageError
from slamreplay.maps.grid import FREE, OCCUPIED, OccupancyGrid

#: Unknown cells this near to walls that were taken off the map become free with them.
_CLEARED_M = 0.5


def appeared(view: BundleView, box_m: Box) -> Injection:
    """The walls in a box are taken off the map: to the map, what stands there is new.

    Unknown cells within half a metre of them become free too: a wall at the edge of the unknown
    would contradict no map that merely ends there.

    Raises:
        UsageError: the box holds no mapped wall.
    """
    grid, rows, cols = _walls(view, box_m)
    edited = _with_cells(view, grid, _cleared(grid, rows, cols))
    return Injection("appeared", edited, view.manifest.start_ns, _around(grid, rows, cols))


def removed(view: BundleView, box_m: Box) -> Injection:
    """A box of walls is drawn onto free cells of the map: to the map, what stood there is gone.

    Raises:
        UsageError: the box holds no free cell.
    """
    grid = _grid(view)
    inside = _inside(grid, box_m) & grid.free
    if not inside.any():
        raise UsageError(f"the box {box_m} holds no free cell")
    rows, cols = np.nonzero(inside)
    cells = grid.cells.copy()
    cells[rows, cols] = OCCUPIED
    edited = _with_cells(view, grid, cells)
    return Injection("removed", edited, view.manifest.start_ns, _around(grid, rows, cols))


def moved(view: BundleView, box_m: Box, shift_xy_m: ArrayLike) -> Injection:
    """The walls in a box are drawn elsewhere: to the map, they moved back to where they stand.

    Args:
        view: the evidence.
        box_m: where the walls stand.
        shift_xy_m: (2,) from there to where the map draws them.

    Raises:
        UsageError: the box holds no mapped wall, or nothing of it stays on the map.
    """
    grid, rows, cols = _walls(view, box_m)
    centres = grid.centre_of(np.column_stack([rows, cols]))
    target = grid.cell_of(centres + np.asarray(shift_xy_m, dtype=np.float64))
    target = target[grid.inside(target)]
    if not len(target):
        raise UsageError("the shift takes the walls off the map")
    cells = _cleared(grid, rows, cols)
    cells[target[:, 0], target[:, 1]] = OCCUPIED
    edited = _with_cells(view, grid, cells)
    return Injection(
        "moved",
        edited,
        view.manifest.start_ns,
        _around(grid, rows, cols),
        _around(grid, target[:, 0], target[:, 1]),
    )


def _grid(view: BundleView) -> OccupancyGrid:
    if view.grid is None:
        raise UsageError("the log has no map to edit")
    return view.grid


def _inside(grid: OccupancyGrid, box_m: Box) -> NDArray[np.bool_]:
    """(H, W) cells whose centre lies in a box of the map frame."""
    rows, cols = np.indices(grid.cells.shape)
    xy = grid.centre_of(np.column_stack([rows.ravel(), cols.ravel()]))
    low, high = np.array(box_m[:2]), np.array(box_m[2:])
    return np.asarray(((xy >= low) & (xy <= high)).all(axis=1).reshape(grid.cells.shape))


def _walls(
    view: BundleView, box_m: Box
) -> tuple[OccupancyGrid, NDArray[np.int64], NDArray[np.int64]]:
    grid = _grid(view)
    rows, cols = np.nonzero(_inside(grid, box_m) & grid.occupied)
    if not len(rows):
        raise UsageError(f"the box {box_m} holds no mapped wall")
    return grid, rows, cols


def _cleared(
    grid: OccupancyGrid, rows: NDArray[np.int64], cols: NDArray[np.int64]
) -> NDArray[np.int8]:
    """Cells without these walls, known to be free about where they were."""
    from scipy.ndimage import distance_transform_edt

    cells = grid.cells.copy()
    walls = np.ones(cells.shape, dtype=bool)
    walls[rows, cols] = False
    near = distance_transform_edt(walls) * grid.resolution_m <= _CLEARED_M
    cells[near & (cells < 0)] = FREE
    cells[rows, cols] = FREE
    return cells


def _with_cells(view: BundleView, grid: OccupancyGrid, cells: NDArray[np.int8]) -> BundleView:
    edited = OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)
    return view.with_grid(edited)


def _around(grid: OccupancyGrid, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> Box:
    xy = grid.centre_of(np.column_stack([rows, cols]))
    half = grid.resolution_m / 2
    (x0, y0), (x1, y1) = xy.min(axis=0) - half, xy.max(axis=0) + half
    return (float(x0), float(y0), float(x1), float(y1))
