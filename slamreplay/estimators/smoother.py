"""What a filter would have said at every step had it known what came later."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from slamreplay.geometry.se2 import Array


def smooth(
    x: Array, P: Array, x_prior: Array, P_prior: Array, F: Array | None = None
) -> tuple[Array, Array]:
    """Rauch, Tung and Striebel's smoother: states and covariances given all measurements.

    Backwards from the last step, with C = P F' (P-)^-1 of the step after: x + C (x_s - x-) and
    P + C (P_s - P-) C' (Rauch, Tung, Striebel 1965; Sarkka 2013, theorem 8.2).

    Args:
        x: (K, ..., n) filtered states; runs that share their covariances may stand in between.
        P: (K, n, n) filtered covariances.
        x_prior: (K, ..., n) states predicted before the measurement of their own step; the first
            one is not used.
        P_prior: (K, n, n) covariances of these, positive definite from the second on.
        F: (n, n) how the state moves by itself; the identity by default.

    Returns:
        States (K, ..., n) and covariances (K, n, n).
    """
    F = np.eye(P.shape[-1]) if F is None else F
    out, cov = x.copy(), P.copy()
    for k in range(len(x) - 2, -1, -1):
        C = cho_solve(cho_factor(P_prior[k + 1]), F @ P[k]).T
        out[k] = x[k] + (out[k + 1] - x_prior[k + 1]) @ C.T
        after = P[k] + C @ (cov[k + 1] - P_prior[k + 1]) @ C.T
        cov[k] = 0.5 * (after + after.T)
    return out, cov
