"""Fewer points that say the same: one per cell of a square lattice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array


def thin(points: Array, spacing_m: float) -> Array:
    """The mean of the points (N, 2) in each occupied lattice cell, (M, 2), in cell order.

    A lidar puts most of its points on what is near; without thinning those outvote the rest.
    """
    if not len(points):
        return points
    _, inverse, count = _cells(points, spacing_m)
    sums = [np.bincount(inverse, weights=points[:, axis]) for axis in (0, 1)]
    return np.asarray(np.stack(sums, axis=1) / count[:, None])


def thin_persistent(points: Array, views: NDArray[np.int64], spacing_m: float, limit: int) -> Array:
    """At most `limit` thinned points, those first that more than one view has seen.

    Args:
        points: (N, 2) m.
        views: (N,) which view each comes from; what a single view saw is often a person.
        spacing_m: lattice spacing.
        limit: how many to keep; evenly spread over the rest in cell order.
    """
    if not len(points):
        return points
    _, inverse, count = _cells(points, spacing_m)
    pairs = np.unique(np.stack([inverse, views], axis=1), axis=0)
    seen = np.bincount(pairs[:, 0], minlength=len(count))
    sums = [np.bincount(inverse, weights=points[:, axis]) for axis in (0, 1)]
    mean = np.stack(sums, axis=1) / count[:, None]
    steady = mean[seen > 1]
    kept = steady if len(steady) >= min(limit, len(mean)) // 2 else mean
    if len(kept) > limit:
        kept = kept[np.linspace(0, len(kept) - 1, limit).astype(np.int64)]
    return np.ascontiguousarray(kept)


def _cells(
    points: Array, spacing_m: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    cell = np.floor(points / spacing_m).astype(np.int64)
    cell -= cell.min(axis=0)
    key = cell[:, 1] * (cell[:, 0].max() + 1) + cell[:, 0]
    return np.unique(key, return_inverse=True, return_counts=True)
