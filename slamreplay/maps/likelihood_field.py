"""Distance from every cell to the nearest wall, and what a beam's end point scores there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from slamreplay.maps.grid import OccupancyGrid


def distance_field(grid: OccupancyGrid, max_distance_m: float) -> NDArray[np.float32]:
    """(H, W) distance in metres from each cell's centre to the nearest occupied cell's centre.

    Distances are cut at `max_distance_m`; a map without a single wall has that everywhere.
    """
    walls = grid.occupied
    if not walls.any():
        return np.full(walls.shape, max_distance_m, dtype=np.float32)
    distance = distance_transform_edt(~walls, sampling=grid.resolution_m)
    return np.minimum(distance, max_distance_m).astype(np.float32)


def gaussian_field(
    grid: OccupancyGrid, sigma_m: float, max_distance_m: float
) -> NDArray[np.float32]:
    """(H, W) score in [0, 1] of a beam that ends in the cell: exp(-d^2 / (2 sigma^2))."""
    distance = distance_field(grid, max_distance_m)
    return np.exp(-0.5 * (distance / np.float32(sigma_m)) ** 2).astype(np.float32)
