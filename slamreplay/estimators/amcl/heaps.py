"""What nav2_amcl publishes of its particles, in one pass over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from slamreplay.estimators.amcl.cloud import LEAST_RESULTANT, SHARE
from slamreplay.estimators.amcl.kernels import CELL_M, YAW_CELLS
from slamreplay.estimators.amcl.noise import cos_sin
from slamreplay.geometry.se2 import Array

_HALF = 1 << 23  # cells either side of the map's origin
_ROW = 1 << 24
_MIX = np.uint64(0x9E3779B97F4A7C15)  # Fibonacci hashing (Knuth, TAOCP 3, section 6.4)


@dataclass(frozen=True, eq=False)
class Published:
    """A cloud in short.

    Attributes:
        mean_xyyaw: (3,) weighted mean of its heaviest cluster.
        cov: (3, 3) of the whole cloud: x and y, and the heading's circular variance -2 ln R.
        clusters: how many carry a tenth of the weight or more.
    """

    mean_xyyaw: Array
    cov: Array
    clusters: int


def published(particles: Array, weights: Array) -> Published:
    """Of particles (3, N) with weights (N,) that sum to 1."""
    cell = np.empty(particles.shape[1], dtype=np.int64)
    keys = cell_of(particles, cell)
    mean = np.empty(3)
    clusters = heaviest(particles, weights, cell, cluster_of_cells(keys), SHARE, mean)
    return Published(mean, cov_of(particles, weights), int(clusters))


def cov_of(particles: Array, weights: Array) -> Array:
    """(3, 3) of particles (3, N) with weights (N,): x and y, and the heading's -2 ln R."""
    cov = np.zeros((3, 3))
    resultant = spread(particles, weights, cov)
    cov[2, 2] = -2.0 * np.log(min(max(resultant, LEAST_RESULTANT), 1.0))
    return cov


@njit(cache=True)
def cell_of(particles, cell):  # type: ignore[no-untyped-def]
    """Fill (N,) with the histogram cell each of particles (3, N) is in; the cells' keys.

    Cells are numbered from 0 as they are met, so that N particles need one pass and no sorting.
    """
    n = particles.shape[1]
    slots, keys = _empty_slots(n), np.empty(n, dtype=np.int64)
    found = 0
    for i in range(n):
        col = int(np.floor(particles[0, i] / CELL_M)) + _HALF
        row = int(np.floor(particles[1, i] / CELL_M)) + _HALF
        turn = int((particles[2, i] + np.pi) / (2.0 * np.pi) * YAW_CELLS) % YAW_CELLS
        keys[found] = (row * _ROW + col) * YAW_CELLS + turn
        at = _slot(slots, keys, keys[found])
        if slots[at] < 0:
            slots[at] = found
            found += 1
        cell[i] = slots[at]
    return keys[:found]


@njit(cache=True)
def cluster_of_cells(keys):  # type: ignore[no-untyped-def]
    """(K,) cluster of each cell: those that touch, corners too and across +-pi, are one."""
    n = len(keys)
    slots, root = _empty_slots(n), np.empty(n, dtype=np.int64)
    for k in range(n):
        slots[_slot(slots, keys, keys[k])] = root[k] = k
    for k in range(n):
        place, turn = keys[k] // YAW_CELLS, keys[k] % YAW_CELLS
        for step in range(14, 27):  # half of the 26 neighbours: the others see this one
            beside = place + (step // 9 - 1) * _ROW + (step // 3 % 3 - 1)
            key = beside * YAW_CELLS + (turn + step % 3 - 1) % YAW_CELLS
            other = slots[_slot(slots, keys, key)]
            if other >= 0:
                one, two = _root(root, k), _root(root, other)
                root[max(one, two)] = min(one, two)
    label, found = np.empty(n, dtype=np.int64), 0
    for k in range(n):  # a root comes before all that hang on it
        top = _root(root, k)
        label[k] = found if top == k else label[top]
        found += top == k
    return label


@njit(cache=True)
def _empty_slots(n):  # type: ignore[no-untyped-def]
    """A hash table for n keys: a power of two that is at least twice as long."""
    size = 8
    while size < 2 * n:
        size *= 2
    slots = np.empty(size, dtype=np.int64)
    for at in range(size):
        slots[at] = -1
    return slots


@njit(cache=True)
def _slot(slots, keys, key):  # type: ignore[no-untyped-def]
    """Where a key is, or an empty slot where it is not."""
    mask = len(slots) - 1
    at = np.int64((np.uint64(key) * _MIX) >> np.uint64(32)) & mask
    while slots[at] >= 0 and keys[slots[at]] != key:
        at = (at + 1) & mask
    return at


@njit(cache=True)
def _root(root, k):  # type: ignore[no-untyped-def]
    while root[k] != k:
        root[k] = root[root[k]]
        k = root[k]
    return k


@njit(cache=True)
def heaviest(particles, weights, cell, label, share, mean):  # type: ignore[no-untyped-def]
    """How many clusters have a share; fills the heaviest one's mean (3,).

    Of particles (3, N) with weights (N,), cells (N,) and clusters (K,) of these.
    """
    clusters = 0
    for k in range(len(label)):
        clusters = max(clusters, label[k] + 1)
    sums = np.zeros((clusters, 5))
    for i in range(len(weights)):
        cos, sin = cos_sin(particles[2, i])
        w, k = weights[i], label[cell[i]]
        sums[k, 0] += w
        sums[k, 1] += w * particles[0, i]
        sums[k, 2] += w * particles[1, i]
        sums[k, 3] += w * cos
        sums[k, 4] += w * sin
    best, many = 0, 0
    for k in range(len(sums)):
        many += sums[k, 0] >= share
        best = k if sums[k, 0] > sums[best, 0] else best
    mean[0], mean[1] = sums[best, 1] / sums[best, 0], sums[best, 2] / sums[best, 0]
    mean[2] = np.arctan2(sums[best, 4], sums[best, 3])
    return many


@njit(cache=True)
def spread(particles, weights, cov):  # type: ignore[no-untyped-def]
    """Resultant length of headings; fills the covariance of x and y, of particles (3, N)."""
    total, x, y, c, s = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(weights)):
        w = weights[i]
        cos, sin = cos_sin(particles[2, i])
        total += w
        x += w * particles[0, i]
        y += w * particles[1, i]
        c += w * cos
        s += w * sin
    x, y = x / total, y / total
    xx, xy, yy = 0.0, 0.0, 0.0
    for i in range(len(weights)):
        w, dx, dy = weights[i] / total, particles[0, i] - x, particles[1, i] - y
        xx += w * dx * dx
        xy += w * dx * dy
        yy += w * dy * dy
    cov[0, 0], cov[0, 1], cov[1, 0], cov[1, 1] = xx, xy, xy, yy
    return np.hypot(c, s) / total
