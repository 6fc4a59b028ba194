"""The particle filter's inner loops, compiled; tests hold each against plain numpy.

Random numbers are drawn by the caller, so that the loops are functions of their arguments.
"""

from __future__ import annotations

import numpy as np
from numba import njit

#: Histogram cells of KLD sampling and of clustering, as in nav2_amcl: 0.5 m, 0.5 m, 10 deg.
CELL_M = 0.5
YAW_CELLS = 36
ROW = 1 << 24  # more columns than any cloud is wide
_GOLDEN = 0.6180339887498949  # fractional part of the golden ratio


@njit(cache=True)
def kld_size(bins, count, cumulative, start, least, most, error, quantile):  # type: ignore[no-untyped-def]
    """How many particles bound the KL distance to the true distribution (Fox 2003, KLD sampling).

    Particles are drawn by weight until their number suffices for the k different bins seen; `bins`
    (N,) holds numbers below `count`. The draws follow a golden-ratio sequence from `start` in
    [0, 1): any first n of them cover [0, 1) evenly. A cloud in a single bin needs `least`;
    nav2_amcl takes `most` there.
    """
    seen = np.zeros(count, dtype=np.bool_)
    k = 0
    needed = float(least)
    n = 0
    while n < most and n < needed:
        u = (start + n * _GOLDEN) % 1.0 * cumulative[-1]
        drawn = bins[min(_insertion(cumulative, u), len(bins) - 1)]
        n += 1
        if not seen[drawn]:
            seen[drawn] = True
            k += 1
            if k > 1:
                a = 2.0 / (9.0 * (k - 1))
                x = 1.0 - a + np.sqrt(a) * quantile
                needed = max(float(least), (k - 1) / (2.0 * error) * x * x * x)
    return n


@njit(cache=True)
def systematic(cumulative, start, n):  # type: ignore[no-untyped-def]
    """(n,) rows drawn by weight with one random number in [0, 1) (low-variance sampling)."""
    out = np.empty(n, dtype=np.int64)
    row = 0
    for i in range(n):
        u = (start + i) / n * cumulative[-1]
        while cumulative[row] <= u and row < len(cumulative) - 1:
            row += 1
        out[i] = row
    return out


@njit(cache=True)
def draw(particles, weights, start, out):  # type: ignore[no-untyped-def]
    """Fill (3, n) with particles (3, N) drawn by weight with one random number in [0, 1)."""
    n = out.shape[1]
    total = 0.0
    for i in range(len(weights)):
        total += weights[i]
    row, reached = 0, weights[0]
    for k in range(n):
        at = (start + k) / n * total
        while reached <= at and row < len(weights) - 1:
            row += 1
            reached += weights[row]
        out[0, k], out[1, k], out[2, k] = particles[0, row], particles[1, row], particles[2, row]


@njit(cache=True)
def first_beyond(odometry, last, distance, angle):  # type: ignore[no-untyped-def]
    """The first of poses (N, 3) that is farther from `last` (3,) along x or y, or turned more."""
    for k in range(len(odometry)):
        turn = (odometry[k, 2] - last[2] + np.pi) % (2.0 * np.pi) - np.pi
        if (
            abs(odometry[k, 0] - last[0]) > distance
            or abs(odometry[k, 1] - last[1]) > distance
            or abs(turn) > angle
        ):
            return k
    return len(odometry)


@njit(cache=True)
def cell_numbers(particles, corner):  # type: ignore[no-untyped-def]
    """(N,) number of the histogram cell each particle is in: row, column, heading, in this order.

    `corner` (2,) is a point below and left of every particle.
    """
    out = np.empty(particles.shape[0], dtype=np.int64)
    for i in range(particles.shape[0]):
        col = int(np.floor(particles[i, 0] / CELL_M) - np.floor(corner[0] / CELL_M)) + 1
        row = int(np.floor(particles[i, 1] / CELL_M) - np.floor(corner[1] / CELL_M)) + 1
        turn = int(np.floor((particles[i, 2] + np.pi) / (2.0 * np.pi) * YAW_CELLS)) % YAW_CELLS
        out[i] = (row * ROW + col) * YAW_CELLS + turn
    return out


@njit(cache=True)
def cluster_labels(cells):  # type: ignore[no-untyped-def]
    """(K,) cluster of each of the sorted, distinct cells: cells that touch, corners too, are one.

    Headings touch across +-pi; in nav2_amcl they do not.
    """
    label = np.full(len(cells), -1, dtype=np.int64)
    stack = np.empty(len(cells), dtype=np.int64)
    found = 0
    for first in range(len(cells)):
        if label[first] >= 0:
            continue
        label[first], stack[0], depth = found, first, 1
        while depth > 0:
            depth -= 1
            here = cells[stack[depth]]
            place, turn = here // YAW_CELLS, here % YAW_CELLS
            for step in range(27):
                beside = place + (step // 9 - 1) * ROW + (step // 3 % 3 - 1)
                key = beside * YAW_CELLS + (turn + step % 3 - 1) % YAW_CELLS
                at = _insertion(cells, key) - 1
                if at >= 0 and cells[at] == key and label[at] < 0:
                    label[at], stack[depth] = found, at
                    depth += 1
        found += 1
    return label


@njit(cache=True)
def _insertion(values, value):  # type: ignore[no-untyped-def]
    """How many of the sorted values are not above `value`."""
    low, high = 0, len(values)
    while low < high:
        middle = (low + high) // 2
        if values[middle] <= value:
            low = middle + 1
        else:
            high = middle
    return low
