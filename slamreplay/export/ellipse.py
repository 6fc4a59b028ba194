"""Outlines of covariance ellipses."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.covariance import is_positive_definite
from slamreplay.geometry.se2 import Array

#: Squared radius in standard deviations that holds 95 % of a planar normal distribution:
#: chi-square with two degrees of freedom has the distribution function 1 - exp(-x / 2).
RADIUS_SQUARED_95 = -2.0 * np.log(0.05)


def outlines(xyyaw: Array, cov: Array, points: int = 32) -> Array:
    """(N, K, 2) points on the 95 % ellipses of position, m; NaN where there is no covariance.

    The image of a circle under the Cholesky factor is the ellipse, whatever way it is turned.

    Args:
        xyyaw: (N, 3) poses.
        cov: (N, 3, 3) their covariances, parent axes.
        points: K.
    """
    plane = np.asarray(cov, dtype=np.float64)[:, :2, :2]
    out = np.full((len(xyyaw), points, 2), np.nan)
    known = is_positive_definite(plane) & np.isfinite(xyyaw).all(axis=1)
    angle = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
    circle = np.sqrt(RADIUS_SQUARED_95) * np.stack([np.cos(angle), np.sin(angle)])
    L = np.linalg.cholesky(plane[known])
    out[known] = xyyaw[known, None, :2] + np.swapaxes(L @ circle, -1, -2)
    return out
