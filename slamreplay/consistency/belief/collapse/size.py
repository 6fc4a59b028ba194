"""How large a covariance is: its standard deviation, averaged over the axes that it has."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.se2 import Array


def position_sigma(cov: Array) -> Array:
    """(N,) m: fourth root of det of the position block of (N, 3, 3).

    0 where it is none, NaN where it is not given.
    """
    return np.asarray(_positive(_det(cov[:, :2, :2])) ** 0.25)


def heading_sigma(cov: Array) -> Array:
    """(N,) rad, of (N, 3, 3); 0 where the variance is none."""
    return np.asarray(_positive(cov[:, 2, 2]) ** 0.5)


def mean_sigma(cov: Array) -> Array:
    """(N,) geometric mean over x y yaw of (N, 3, 3): det^(1/6); over x y where no yaw is given.

    Its unit is mixed: only its ratios mean anything.
    """
    if not np.isfinite(cov[:, 2, 2]).all():
        return position_sigma(cov)
    return np.asarray(_positive(_det(cov)) ** (1.0 / 6.0))


def _det(cov: Array) -> Array:
    with np.errstate(invalid="ignore"):  # of what was not given
        return np.asarray(np.linalg.det(cov))


def _positive(value: Array) -> Array:
    with np.errstate(invalid="ignore"):
        return np.where(value < 0.0, 0.0, value)
