"""The inner loops of the filter on board, compiled; tests hold each against plain numpy.

Random numbers are drawn by the caller, so that the loops are functions of their arguments.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def move(particles, motion, sigma, noise):  # type: ignore[no-untyped-def]
    """Move particles (N, 3) in place by first turn, distance, second turn (3,) less noise.

    `noise` (N, 3) is standard normal, `sigma` (3,) its scale (sample_motion_odometry, Thrun,
    Burgard, Fox: Probabilistic Robotics, p. 136).
    """
    for i in range(particles.shape[0]):
        heading = particles[i, 2] + motion[0] - sigma[0] * noise[i, 0]
        distance = motion[1] - sigma[1] * noise[i, 1]
        particles[i, 0] += distance * np.cos(heading)
        particles[i, 1] += distance * np.sin(heading)
        yaw = heading + motion[2] - sigma[2] * noise[i, 2]
        particles[i, 2] = (yaw + np.pi) % (2.0 * np.pi) - np.pi


@njit(cache=True)
def likelihoods(particles, ends, scores, origin, resolution):  # type: ignore[no-untyped-def]
    """(N,) likelihood of a scan at each particle: 1 plus the score of the cell each beam ends in.

    Args: particles (N, 3) base in map; ends (2, M) of the beams in the base frame, m; scores
    (H + 2, W + 2) float32 by cell, with a border of what lies off the map; origin (3,) and
    resolution of the grid. Cells are found first and looked up then: three times as fast as both
    in one loop, which the branch at the border keeps from being vectorised.
    """
    height, width = scores.shape
    flat = scores.ravel()
    cells = np.empty(ends.shape[1], dtype=np.int64)
    cos_o, sin_o = np.cos(origin[2]), np.sin(origin[2])
    out = np.empty(particles.shape[0])
    for i in range(particles.shape[0]):
        dx, dy = particles[i, 0] - origin[0], particles[i, 1] - origin[1]
        x = (cos_o * dx + sin_o * dy) / resolution + 1.0
        y = (cos_o * dy - sin_o * dx) / resolution + 1.0
        cos = np.cos(particles[i, 2] - origin[2]) / resolution
        sin = np.sin(particles[i, 2] - origin[2]) / resolution
        for j in range(ends.shape[1]):
            col = min(max(x + cos * ends[0, j] - sin * ends[1, j], 0.0), width - 1.0)
            row = min(max(y + sin * ends[0, j] + cos * ends[1, j], 0.0), height - 1.0)
            cells[j] = int(row) * width + int(col)
        total = 1.0
        for j in range(len(cells)):
            total += flat[cells[j]]
        out[i] = total
    return out
