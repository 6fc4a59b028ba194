"""Fewer points that say the same: one per cell of a square lattice."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array


def thin(points: Array, spacing_m: float) -> Array:
    """The mean of the points (N, 2) in each occupied lattice cell, (M, 2), in cell order.

    A lidar puts most of its points on what is near; without thinning those outvote the rest.
    """
    return _means(points, np.empty(0, dtype=np.int64), spacing_m)[0]


def thin_persistent(points: Array, views: NDArray[np.int64], spacing_m: float, limit: int) -> Array:
    """At most `limit` thinned points, those first that more than one view has seen.

    Args:
        points: (N, 2) m.
        views: (N,) which view each comes from, ascending; what a single view saw is often a person.
        spacing_m: lattice spacing.
        limit: how many to keep; evenly spread over the rest in cell order.
    """
    mean, seen = _means(points, views, spacing_m)
    steady = mean[seen > 1]
    kept = steady if len(steady) >= min(limit, len(mean)) // 2 else mean
    if len(kept) > limit:
        kept = kept[np.linspace(0, len(kept) - 1, limit).astype(np.int64)]
    return np.ascontiguousarray(kept)


def _means(
    points: Array, views: NDArray[np.int64], spacing_m: float
) -> tuple[Array, NDArray[np.int64]]:
    """The mean (M, 2) of each occupied cell and how many views (M,) it has points of."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    mean, seen = np.empty((len(points), 2)), np.zeros(len(points), dtype=np.int64)
    if not len(points):
        return mean, seen
    keys = np.empty(len(points), dtype=np.int64)
    _keys(points, spacing_m, keys)
    keys.sort()
    count = _average(points, views, keys, mean, seen)
    return mean[:count], seen[:count]


@njit(cache=True, nogil=True)
def _keys(points, spacing, keys):  # type: ignore[no-untyped-def]
    """Number of each point's cell times the number of points, plus its own number."""
    first_col = first_row = np.inf
    last_col = -np.inf
    count = points.shape[0]
    for p in range(count):
        col, row = np.floor(points[p, 0] / spacing), np.floor(points[p, 1] / spacing)
        first_col, last_col = min(first_col, col), max(last_col, col)
        first_row = min(first_row, row)
    width = int(last_col - first_col) + 1
    for p in range(count):
        col = int(np.floor(points[p, 0] / spacing) - first_col)
        row = int(np.floor(points[p, 1] / spacing) - first_row)
        keys[p] = (row * width + col) * count + p


@njit(cache=True, nogil=True)
def _average(points, views, keys, mean, seen):  # type: ignore[no-untyped-def]
    """Fill in the means and views of the cells in the order of sorted keys; the number of cells."""
    count, found, here = keys.shape[0], -1, np.int64(-1)
    last, members = np.int64(-1), 0
    for k in range(count):
        cell, p = keys[k] // count, keys[k] % count
        if cell != here:
            if found >= 0:
                mean[found, 0] /= members
                mean[found, 1] /= members
            here, members, last = cell, 0, np.int64(-1)
            found += 1
            mean[found, 0] = mean[found, 1] = 0.0
        mean[found, 0] += points[p, 0]
        mean[found, 1] += points[p, 1]
        members += 1
        if views.shape[0] > 0 and views[p] != last:
            last = views[p]
            seen[found] += 1
    mean[found, 0] /= members
    mean[found, 1] /= members
    return found + 1
