"""Where the particles are before anything was seen: about a pose, or anywhere in the map."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.errors import MapError
from slamreplay.geometry.se2 import Array
from slamreplay.maps.grid import OccupancyGrid


def about(rng: np.random.Generator, mean_xyyaw: ArrayLike, cov: ArrayLike, n: int) -> Array:
    """(n, 3) particles drawn about a pose (3,) of covariance (3, 3); of zeros: all on the pose."""
    values, vectors = np.linalg.eigh(np.asarray(cov, dtype=np.float64))
    scale = vectors * np.sqrt(np.maximum(values, 0.0))
    noise = rng.standard_normal((n, 3))
    return np.asarray(np.asarray(mean_xyyaw, dtype=np.float64) + noise @ scale.T)


def anywhere(rng: np.random.Generator, grid: OccupancyGrid, n: int) -> Array:
    """(n, 3) particles spread evenly over a map's free cells and all headings.

    Raises:
        MapError: no cell of the map is free.
    """
    free = np.argwhere(grid.free)
    if not len(free):
        raise MapError("the map has no free cell to start in")
    cell = free[rng.integers(0, len(free), n)]
    xy = grid.centre_of(cell + rng.random((n, 2)) - 0.5)
    return np.column_stack([xy, rng.random(n) * 2.0 * np.pi - np.pi])
