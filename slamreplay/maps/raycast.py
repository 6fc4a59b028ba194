"""Exact ray casting through the grid (Amanatides and Woo, 1987), compiled."""

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
    return np.asarray(
        _cast(
            grid.occupied,
            grid.resolution_m,
            np.ascontiguousarray(local),
            np.ascontiguousarray(bearings, dtype=np.float64),
            max_range_m,
        )
    )


@njit(cache=True)
def _cast(walls, resolution, local, bearings, max_range):  # type: ignore[no-untyped-def]
    out = np.empty((local.shape[0], bearings.shape[0]))
    for i in range(local.shape[0]):
        for j in range(bearings.shape[0]):
            angle = local[i, 2] + bearings[j]
            out[i, j] = resolution * first_wall(
                walls,
                local[i, 0] / resolution,
                local[i, 1] / resolution,
                np.cos(angle),
                np.sin(angle),
                max_range / resolution,
            )
    return out


@njit(cache=True)
def first_wall(walls, x, y, dx, dy, limit):  # type: ignore[no-untyped-def]
    """Distance in cells from (x, y) along the unit vector (dx, dy) to the first wall, or inf."""
    height, width = walls.shape
    col, row = int(np.floor(x)), int(np.floor(y))
    step_col, step_row = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    delta_col = np.inf if dx == 0.0 else abs(1.0 / dx)
    delta_row = np.inf if dy == 0.0 else abs(1.0 / dy)
    to_col = np.inf if dx == 0.0 else ((col + 1 - x) if dx > 0 else (x - col)) * delta_col
    to_row = np.inf if dy == 0.0 else ((row + 1 - y) if dy > 0 else (y - row)) * delta_row
    travelled = 0.0
    while travelled <= limit:
        inside = 0 <= row < height and 0 <= col < width
        if inside and walls[row, col]:
            return travelled
        if not inside and (
            (col < 0 and dx <= 0)
            or (col >= width and dx >= 0)
            or (row < 0 and dy <= 0)
            or (row >= height and dy >= 0)
        ):
            return np.inf  # outside and leaving
        if to_col < to_row:
            travelled = to_col
            to_col += delta_col
            col += step_col
        else:
            travelled = to_row
            to_row += delta_row
            row += step_row
    return np.inf
