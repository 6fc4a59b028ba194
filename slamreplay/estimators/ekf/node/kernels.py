"""The loop of the node's filter, compiled: a planar omnidirectional robot of constant acceleration.

The state is x, y, yaw in the world, and vx, vy, vyaw, ax, ay in the base.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from slamreplay.estimators.ekf.kernels import (
    ACCEPTED,
    REJECTED,
    clear,
    correct,
    innovate,
    lower,
    squared,
    wrapped,
)

STATES = 8
#: No variance of a measurement is taken to be below this (Ekf::correct).
_LEAST = 1e-9


@njit(cache=True)
def carried(J, P):  # type: ignore[no-untyped-def]
    """P becomes J P J', in place; J is sparse."""
    n = P.shape[0]
    JP = np.zeros((n, n))
    for i in range(n):
        for k in range(n):
            if J[i, k] != 0.0:
                for j in range(n):
                    JP[i, j] += J[i, k] * P[k, j]
    clear(P)
    for j in range(n):
        for k in range(n):
            if J[j, k] != 0.0:
                for i in range(n):
                    P[i, j] += JP[i, k] * J[j, k]


@njit(cache=True)
def predict(x, P, dt, Q, scales):  # type: ignore[no-untyped-def]
    """Carry state (8,) and covariance (8, 8) over dt seconds, in place: P = J P J' + dt Q.

    Where `scales` is set, the pose's part of Q is multiplied by the squared norm of the velocity.
    """
    cos, sin, half = np.cos(x[2]), np.sin(x[2]), 0.5 * dt * dt
    J = np.eye(STATES)
    J[0, 3], J[0, 4], J[0, 6], J[0, 7] = cos * dt, -sin * dt, cos * half, -sin * half
    J[1, 3], J[1, 4], J[1, 6], J[1, 7] = sin * dt, cos * dt, sin * half, cos * half
    along, across = x[3] * dt + x[6] * half, x[4] * dt + x[7] * half
    J[0, 2], J[1, 2] = -sin * along - cos * across, cos * along - sin * across
    J[2, 5], J[3, 6], J[4, 7] = dt, dt, dt
    speed = x[3] * x[3] + x[4] * x[4] + x[5] * x[5] if scales else 1.0
    x[0] += cos * along - sin * across
    x[1] += sin * along + cos * across
    x[2] = wrapped(x[2] + x[5] * dt)
    x[3] += x[6] * dt
    x[4] += x[7] * dt
    carried(J, P)
    for i in range(STATES):
        for j in range(STATES):
            P[i, j] += dt * Q[i, j] * (speed if i < 3 and j < 3 else 1.0)


@njit(cache=True)
def run(  # type: ignore[no-untyped-def]  # noqa: C901 - the filter's loop
    t_ns,
    measured,
    row,
    z,
    R,
    used,
    lever,
    threshold,
    Q,
    scales,
    x,
    P,
    start_ns,
    xyyaw_out,
    cov_out,
    updated_out,
    residual_out,
    S_out,
    status_out,
    moved_out,
):
    """Run all events (E,) in order of their times `t_ns`.

    Args: `measured` and `row` (E,) the index of what happens there or -1. Of the measurements
    (K,): z (K, 8), R (K, 8, 8), `used` (K, 8) which of them are measured, `lever` (K, 2) where in
    the base the velocity was measured, `threshold` (K,) largest Mahalanobis distance. Q (8, 8)
    per second, `scales` as of `predict`, state x (8,) and P (8, 8) at `start_ns`, -1 where
    the first measurement starts the filter. The outputs are filled in by row and by measurement,
    axes in the order of `used`; what comes before the start stays as it is.
    """
    H, HP = np.zeros((STATES, STATES)), np.zeros((STATES, STATES))
    S, L = np.zeros((STATES, STATES)), np.zeros((STATES, STATES))
    noise, residual = np.zeros((STATES, STATES)), np.zeros(STATES)
    index, before = np.zeros(STATES, dtype=np.int64), np.zeros(3)
    ahead, P_ahead = np.zeros(STATES), np.zeros((STATES, STATES))
    last_ns, fresh, is_started = start_ns, 0.0, start_ns >= 0
    for e in range(len(t_ns)):
        if t_ns[e] < start_ns:
            continue
        k = row[e]
        if k >= 0 and is_started:
            for i in range(STATES):
                ahead[i] = x[i]
                for j in range(STATES):
                    P_ahead[i, j] = P[i, j]
            if t_ns[e] > last_ns:
                predict(ahead, P_ahead, (t_ns[e] - last_ns) * 1e-9, Q, scales)
            for i in range(3):
                xyyaw_out[k, i] = ahead[i]
                for j in range(3):
                    cov_out[k, i, j] = P_ahead[i, j]
            updated_out[k] = fresh
            fresh = 0.0
        s = measured[e]
        if s < 0:
            continue
        m = 0
        for i in range(STATES):
            if used[s, i]:
                index[m] = i
                m += 1
        if not is_started:
            for r in range(m):
                x[index[r]] = z[s, index[r]]
                for c in range(m):
                    P[index[r], index[c]] = R[s, index[r], index[c]]
                P[index[r], index[r]] = max(abs(P[index[r], index[r]]), _LEAST)
            is_started, last_ns, fresh = True, t_ns[e], 1.0
            continue
        if t_ns[e] > last_ns:
            predict(x, P, (t_ns[e] - last_ns) * 1e-9, Q, scales)
        last_ns = t_ns[e]
        clear(H)
        for r in range(m):
            i = index[r]
            H[r, i] = 1.0
            residual[r] = z[s, i] - x[i]
            if i == 2:
                residual[r] = wrapped(residual[r])
            elif i == 3:
                residual[r] += lever[s, 1] * x[5]
            elif i == 4:
                residual[r] -= lever[s, 0] * x[5]
            for c in range(m):
                noise[r, c] = R[s, i, index[c]]
            noise[r, r] = max(abs(noise[r, r]), _LEAST)
        innovate(P, H, noise, m, HP, S)
        for r in range(m):
            residual_out[s, r] = residual[r]
            for c in range(m):
                S_out[s, r, c] = S[r, c]
        for i in range(3):
            moved_out[s, i], before[i] = 0.0, x[i]
        status_out[s] = REJECTED
        if not lower(S, m, L) or squared(L, residual, m) >= threshold[s] * threshold[s]:
            continue
        correct(x, P, H, noise, m, HP, L, residual)
        status_out[s] = ACCEPTED
        fresh = 1.0
        for i in range(3):
            moved_out[s, i] = x[i] - before[i]
        moved_out[s, 2] = wrapped(moved_out[s, 2])
