"""Maps edited against a recorded log, so that what stands there has appeared, gone or moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.bench.injection import Box, Injection
from slamreplay.bundle.view import BundleView
from slamreplay.errors import UsageError
from slamreplay.maps.edits import with_walls, with_walls_moved, without_walls
from slamreplay.maps.grid import OccupancyGrid


def appeared(view: BundleView, box_m: Box) -> Injection:
    """The walls in a box are taken off the map: to the map, what stands there is new.

    Raises:
        UsageError: the box holds no mapped wall.
    """
    grid, walls = _walls(view, box_m)
    edited = view.with_grid(without_walls(grid, walls))
    return Injection("appeared", edited, view.manifest.start_ns, _around(grid, walls))


def removed(view: BundleView, box_m: Box) -> Injection:
    """A box of walls is drawn onto free cells of the map: to the map, what stood there is gone.

    Raises:
        UsageError: the box holds no free cell.
    """
    grid = _grid(view)
    cells = np.argwhere(_inside(grid, box_m) & grid.free)
    if not len(cells):
        raise UsageError(f"the box {box_m} holds no free cell")
    edited = view.with_grid(with_walls(grid, cells))
    return Injection("removed", edited, view.manifest.start_ns, _around(grid, cells))


def moved(view: BundleView, box_m: Box, shift_xy_m: ArrayLike) -> Injection:
    """The walls in a box are drawn elsewhere: to the map, they moved back to where they stand.

    Args:
        view: the evidence.
        box_m: where the walls stand.
        shift_xy_m: (2,) from there to where the map draws them.

    Raises:
        UsageError: the box holds no mapped wall, or nothing of it stays on the map.
    """
    grid, walls = _walls(view, box_m)
    edited, target = with_walls_moved(grid, walls, shift_xy_m)
    if not len(target):
        raise UsageError("the shift takes the walls off the map")
    return Injection(
        "moved",
        view.with_grid(edited),
        view.manifest.start_ns,
        _around(grid, walls),
        _around(grid, target),
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


def _walls(view: BundleView, box_m: Box) -> tuple[OccupancyGrid, NDArray[np.int64]]:
    grid = _grid(view)
    walls = np.argwhere(_inside(grid, box_m) & grid.occupied)
    if not len(walls):
        raise UsageError(f"the box {box_m} holds no mapped wall")
    return grid, walls


def _around(grid: OccupancyGrid, cells: NDArray[np.int64]) -> Box:
    xy = grid.centre_of(cells)
    half = grid.resolution_m / 2
    (x0, y0), (x1, y1) = xy.min(axis=0) - half, xy.max(axis=0) + half
    return (float(x0), float(y0), float(x1), float(y1))
