"""Errors in units of what was claimed for them: L^-1 e with P = L L'."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.geometry.covariance import is_positive_definite
from slamreplay.geometry.se2 import Array


def whitened(error: ArrayLike, cov: ArrayLike) -> Array:
    """(N, m) errors (N, m) whitened by covariances (N, m, m): independent, of unit variance.

    By forward substitution with Cholesky's factor; no covariance is ever inverted. Rows that are
    not finite, or whose covariance is not symmetric and positive definite, are NaN. The squared
    length of a row is its NEES.
    """
    e, P = np.asarray(error, dtype=np.float64), np.asarray(cov, dtype=np.float64)
    out = np.full(e.shape, np.nan)
    sound = np.isfinite(e).all(axis=1) & is_positive_definite(P)
    L, e = np.linalg.cholesky(P[sound]), e[sound]
    white = np.zeros_like(e)
    for i in range(e.shape[1]):
        known = np.einsum("nj,nj->n", L[:, i, :i], white[:, :i])
        white[:, i] = (e[:, i] - known) / L[:, i, i]
    out[sound] = white
    return out
