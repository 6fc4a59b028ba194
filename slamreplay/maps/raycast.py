"""Exact ray casting through the grid (Amanatides and Woo, 1987), compiled.

A frame of cells that bar the way stands for the map's edge, so that a step asks but one cell. Along
the axis whose cells a ray crosses more often it steps without a choice: one that a processor
guesses wrong costs more than the step.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid


def cast_rays(
    grid: OccupancyGrid, xyyaw: se2.Array, bearings: se2.Array, max_range_m: float
) -> NDArray[np.float64]:
    """(N, M) range in metres to the first occupied cell along each ray, `inf` where there is none.

    Args:
        grid: the map; its origin's yaw is honoured.
        xyyaw: (N, 3) poses of the sensor in the map frame.
        bearings: (M,) angles of the rays in the sensor frame, rad.
        max_range_m: rays are followed no further.
    """
    local = se2.compose(se2.inverse(grid.origin_xyyaw), np.atleast_2d(xyyaw))
    bearings = np.ascontiguousarray(bearings, dtype=np.float64)
    ranges = np.empty((len(local), len(bearings)))
    limit = max_range_m / grid.resolution_m
    _cast(grid.barred, grid.resolution_m, np.ascontiguousarray(local), bearings, limit, ranges)
    return ranges


@njit(cache=True, nogil=True)
def _cast(barred, resolution, local, bearings, limit, ranges):  # type: ignore[no-untyped-def]
    for i in range(local.shape[0]):
        x, y = local[i, 0] / resolution, local[i, 1] / resolution
        for j in range(bearings.shape[0]):
            angle = local[i, 2] + bearings[j]
            ranges[i, j] = resolution * _first_wall(
                barred, x, y, np.cos(angle), np.sin(angle), limit
            )


@njit(cache=True, nogil=True)
def _first_wall(barred, x, y, dx, dy, limit):  # type: ignore[no-untyped-def]  # noqa: C901
    """Distance in cells from (x, y) along the unit vector (dx, dy) to the first wall, or inf."""
    height, width = barred.shape
    col, row = int(np.floor(x)), int(np.floor(y))
    delta_col = np.inf if dx == 0.0 else abs(1.0 / dx)
    delta_row = np.inf if dy == 0.0 else abs(1.0 / dy)
    to_col = np.inf if dx == 0.0 else ((col + 1 - x) if dx > 0 else (x - col)) * delta_col
    to_row = np.inf if dy == 0.0 else ((row + 1 - y) if dy > 0 else (y - row)) * delta_row
    if not (0 <= row < height - 2 and 0 <= col < width - 2):
        return _from_outside(barred, col, row, dx, dy, to_col, to_row, limit)
    cells, at = barred.ravel(), (row + 1) * width + col + 1
    step_col, step_row = (1 if dx > 0 else -1), (width if dy > 0 else -width)
    travelled = 0.0
    # The limit is looked at where the rarer axis is crossed: what runs over it ends on the frame.
    if delta_col <= delta_row:
        while not cells[at]:
            if to_row <= to_col:
                travelled = to_row
                to_row += delta_row
                at += step_row
                if cells[at] or travelled > limit:
                    break
                # Another row that is reached as early as the column goes first, too.
                if to_row <= to_col:
                    travelled = to_row
                    to_row += delta_row
                    at += step_row
                    if cells[at]:
                        break
            travelled = to_col
            to_col += delta_col
            at += step_col
    else:
        while not cells[at]:
            if to_col < to_row:
                travelled = to_col
                to_col += delta_col
                at += step_col
                if cells[at] or travelled > limit:
                    break
            travelled = to_row
            to_row += delta_row
            at += step_row
    row, col = at // width, at % width
    inside = 0 < row < height - 1 and 0 < col < width - 1
    return travelled if inside and cells[at] and travelled <= limit else np.inf


@njit(cache=True, nogil=True)
def _from_outside(barred, col, row, dx, dy, to_col, to_row, limit):  # type: ignore[no-untyped-def]
    """Distance in cells to the first wall for a ray that starts outside the map, or inf."""
    height, width = barred.shape[0] - 2, barred.shape[1] - 2
    travelled = 0.0
    while travelled <= limit:
        if 0 <= row < height and 0 <= col < width:
            if barred[row + 1, col + 1]:
                return travelled
        elif (
            (col < 0 and dx <= 0)
            or (col >= width and dx >= 0)
            or (row < 0 and dy <= 0)
            or (row >= height and dy >= 0)
        ):
            return np.inf  # leaving
        if to_col < to_row:
            travelled = to_col
            to_col += abs(1.0 / dx)
            col += 1 if dx > 0 else -1
        else:
            travelled = to_row
            to_row += abs(1.0 / dy)
            row += 1 if dy > 0 else -1
    return np.inf
