"""One step of a Kalman filter, and the innovation of a range to a landmark."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.geometry.se2 import Array


@dataclass(frozen=True, eq=False)
class Correction:
    """What a measurement did.

    Attributes:
        x: (n,) state after it.
        P: (n, n) covariance after it.
        innovation: (m,) measured minus predicted.
        S: (m, m) covariance of the innovation, from the covariance *before* the measurement.
        gain: (n, m) share of the innovation that each state takes.
    """

    x: Array
    P: Array
    innovation: Array
    S: Array
    gain: Array


def predict(
    x: ArrayLike, P: ArrayLike, u: ArrayLike, Q: ArrayLike, F: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Carry state and covariance over a step: x = F x + u, P = F P F' + Q.

    Args:
        x: (n,) state.
        P: (n, n) its covariance.
        u: (n,) what the control adds to it.
        Q: (n, n) noise of the motion.
        F: (n, n) how the state moves by itself; the identity by default.
    """
    state, cov = _vector(x), _matrix(P)
    F = np.eye(len(state)) if F is None else _matrix(F)
    return F @ state + _vector(u), F @ cov @ F.T + _matrix(Q)


def correct(
    x: ArrayLike, P: ArrayLike, innovation: ArrayLike, H: ArrayLike, R: ArrayLike
) -> Correction:
    """Take in a measurement; the covariance in Joseph's form, which stays symmetric and positive.

    Args:
        x: (n,) predicted state.
        P: (n, n) its covariance.
        innovation: (m,) measured minus predicted.
        H: (m, n) derivative of the measurement by the state.
        R: (m, m) noise of the measurement.
    """
    state, cov, residual = _vector(x), _matrix(P), _vector(innovation)
    H, R = _matrix(H), _matrix(R)
    S = H @ cov @ H.T + R
    gain = np.asarray(np.linalg.solve(S, H @ cov).T, dtype=np.float64)
    left = np.eye(len(state)) - gain @ H
    after = left @ cov @ left.T + gain @ R @ gain.T
    return Correction(state + gain @ residual, after, residual, S, gain)


def kalman_step(
    x: ArrayLike,
    P: ArrayLike,
    u: ArrayLike,
    Q: ArrayLike,
    z: ArrayLike,
    R: ArrayLike,
    H: ArrayLike | None = None,
) -> Correction:
    """Predict by a control `u`, then take in `z`, which measures H x (the state by default)."""
    prior, P_prior = predict(x, P, u, Q)
    H = np.eye(len(prior)) if H is None else _matrix(H)
    return correct(prior, P_prior, _vector(z) - H @ prior, H, R)


def range_prediction(xy_m: ArrayLike, landmark_xy_m: ArrayLike) -> tuple[float, Array]:
    """The range from a position (2,) to a landmark (2,) in m, and its derivative (1, 2).

    At the landmark itself the range has no derivative; it is zero there.
    """
    away = _vector(xy_m) - _vector(landmark_xy_m)
    distance = float(np.hypot(*away))
    return distance, (away / distance if distance > 0.0 else np.zeros(2))[None]


def _vector(value: ArrayLike) -> Array:
    return np.atleast_1d(np.asarray(value, dtype=np.float64))


def _matrix(value: ArrayLike) -> Array:
    return np.atleast_2d(np.asarray(value, dtype=np.float64))
