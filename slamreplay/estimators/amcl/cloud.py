"""What a particle cloud says: its clusters as nav2_amcl makes them, its mean and its spread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.amcl import kernels
from slamreplay.geometry.se2 import Array

#: Resultant length of a cloud of headings that point everywhere; keeps -2 ln R finite.
LEAST_RESULTANT = 1e-12
#: A cluster that carries this share of the weight counts.
SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Moments:
    """Mean pose (3,) and covariance (3, 3) of particles, xy and yaw uncoupled, as nav2_amcl has it.

    The variance of the heading is circular: -2 ln R, R the length of the mean heading vector.
    """

    mean_xyyaw: Array
    cov: Array


def histogram(particles: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct cells of the cloud (N, 3), sorted, and (N,) the one each particle is in."""
    cells = kernels.cell_numbers(particles, particles[:, :2].min(axis=0))
    return np.unique(cells, return_inverse=True)


def cluster_of(particles: Array) -> NDArray[np.int64]:
    """(N,) cluster of each particle (N, 3): what lies in cells that touch is one."""
    distinct, bins = histogram(particles)
    return np.asarray(kernels.cluster_labels(distinct)[bins])


def moments(particles: Array, weights: Array) -> Moments:
    """Of particles (N, 3) with weights (N,) that sum to any."""
    mean, resultant = circular_moments(particles, weights)
    off = particles[:, :2] - mean[:2]
    cov = np.zeros((3, 3))
    cov[:2, :2] = (off * (weights / weights.sum())[:, None]).T @ off
    cov[2, 2] = -2.0 * np.log(np.clip(resultant, LEAST_RESULTANT, 1.0))
    return Moments(mean, cov)


def circular_moments(particles: Array, weights: Array) -> tuple[Array, float]:
    """Weighted mean pose (3,) and resultant length of the headings, of weights that sum to any."""
    share = weights / weights.sum()
    x, y = share @ particles[:, 0], share @ particles[:, 1]
    cos, sin = share @ np.cos(particles[:, 2]), share @ np.sin(particles[:, 2])
    return np.array([x, y, np.arctan2(sin, cos)]), float(np.hypot(cos, sin))
