"""The smoother against one least-squares problem over the whole chain."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.estimators.kalman import correct, predict
from slamreplay.estimators.smoother import smooth


def filtered(F, Q, H, R, x0, P0, z):
    """A filter over measurements (K, m), NaN where there is none."""
    x, P = x0, P0
    out = [(x, P, x, P)]
    for k in range(1, len(z)):
        x_prior, P_prior = predict(x, P, np.zeros(len(x)), Q, F)
        x, P = x_prior, P_prior
        if np.isfinite(z[k]).all():
            step = correct(x, P, z[k] - H @ x, H, R)
            x, P = step.x, step.P
        out.append((x, P, x_prior, P_prior))
    return [np.array(part) for part in zip(*out, strict=True)]


def least_squares(F, Q, H, R, x0, P0, z):
    """The same chain as one Gaussian: mean and marginal covariances from its information matrix."""
    K, n = len(z), len(x0)
    A, b = np.zeros((K * n, K * n)), np.zeros(K * n)

    def add(J, target, W):
        A[:] += J.T @ np.linalg.inv(W) @ J
        b[:] += J.T @ np.linalg.inv(W) @ target

    eye = np.eye(K * n).reshape(K, n, K * n)
    add(eye[0], x0, P0)
    for k in range(1, K):
        add(eye[k] - F @ eye[k - 1], np.zeros(n), Q)
        if np.isfinite(z[k]).all():
            add(H @ eye[k], z[k], R)
    cov = np.linalg.inv(A)
    return (cov @ b).reshape(K, n), np.array([eye[k] @ cov @ eye[k].T for k in range(K)])


@given(st.integers(0, 10_000), st.integers(2, 9))
def test_smoothing_is_least_squares_over_the_chain(seed, steps):
    rng = np.random.default_rng(seed)
    F = np.array([[1.0, 0.5], [0.0, 0.9]])
    Q, H, R = np.diag([0.2, 0.1]), np.array([[1.0, 0.0]]), np.array([[0.3]])
    z = rng.normal(size=(steps, 1))
    z[rng.random(steps) < 0.5] = np.nan
    chain = (F, Q, H, R, np.array([0.5, -0.2]), np.diag([0.4, 0.6]), z)

    x, P = smooth(*filtered(*chain), F)

    x_all, P_all = least_squares(*chain)
    np.testing.assert_allclose(x, x_all, atol=1e-9)
    np.testing.assert_allclose(P, P_all, atol=1e-9)


def test_many_runs_share_their_covariances():
    Q, R = np.array([[0.2]]), np.array([[0.3]])
    z = np.random.default_rng(1).normal(size=(6, 4))
    one = [
        filtered(np.eye(1), Q, np.eye(1), R, np.zeros(1), np.eye(1), z[:, [k]]) for k in range(4)
    ]
    many = [np.stack([run[part] for run in one], axis=1) for part in (0, 2)]

    x, P = smooth(many[0], one[0][1], many[1], one[0][3])

    for k, run in enumerate(one):
        alone, P_alone = smooth(*run)
        np.testing.assert_allclose(x[:, k], alone)
        np.testing.assert_allclose(P, P_alone)
