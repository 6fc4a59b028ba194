"""A small linear Kalman filter of which everything is known, and what its innovations say."""

import numpy as np
from scipy.signal import lfilter

from slamreplay.bundle.run import Innovations
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.estimators import kalman
from slamreplay.testing import believed

STEP_NS = 100_000_000
Q = np.diag([0.02, 0.01]) ** 2
SENSORS = {
    "position": (np.eye(2), np.diag([0.03, 0.02]) ** 2, ("x m", "y m")),
    "range": (np.array([[0.8, -0.6]]), np.array([[0.1]]) ** 2, ("range m",)),
}
VIEW = believed(0, rows=5).view


def filters(
    seeds, n=500, *, told_R=1.0, told_Q=1.0, memory=0.0, bias=0.0, outliers=0.0, gate=np.inf
):
    """Innovations of a position sensor and of a range, by seed.

    Args:
        seeds: how many.
        n: steps; each brings one measurement of both.
        told_R: claimed over true variance of the range, told_Q that of the motion.
        memory: correlation of the range's noise from one to the next.
        bias: of the range, m.
        outliers: share of ranges that are off by anything within +-3 m.
        gate: NIS of a range above which the filter leaves it out.
    """
    rng = np.random.default_rng(7)
    x = np.cumsum(rng.standard_normal((seeds, n, 2)) * np.sqrt(np.diag(Q)), axis=1)
    position = x + rng.standard_normal((seeds, n, 2)) @ np.sqrt(SENSORS["position"][1])
    noise = rng.standard_normal((seeds, n))
    noise[:, 1:] *= np.sqrt(1.0 - memory**2)
    noise = 0.1 * lfilter([1.0], [1.0, -memory], noise, axis=1)
    noise += (rng.random((seeds, n)) < outliers) * rng.uniform(-3.0, 3.0, (seeds, n))
    measured = {"position": position, "range": (x @ SENSORS["range"][0].T) + noise[:, :, None]}
    measured["range"] += bias
    one = _gated if np.isfinite(gate) else _together
    return one(measured, told_R, told_Q, gate)


def told(innovations, names=("innovation_bias", "nis", "whiteness")):
    """The findings of checks on a run with these innovations."""
    return ask([CheckContext(None, (), VIEW, "kf", innovations)], names)


def _together(measured, told_R, told_Q, _gate):
    """Without a gate all filters share covariances and gains."""
    seeds, n, _ = measured["position"].shape
    at, P = np.zeros((seeds, 2)), np.zeros((2, 2))
    residual = {name: np.empty(z.shape) for name, z in measured.items()}
    S = {name: np.empty((n, *R.shape)) for name, (_, R, _) in SENSORS.items()}
    for k in range(n):
        _, P = kalman.predict(np.zeros(2), P, np.zeros(2), told_Q * Q)
        for name, (H, R, _) in SENSORS.items():
            R = told_R * R if name == "range" else R
            residual[name][:, k] = measured[name][:, k] - at @ H.T
            step = kalman.correct(np.zeros(2), P, np.zeros(len(H)), H, R)
            at, P, S[name][k] = at + residual[name][:, k] @ step.gain.T, step.P, step.S
    used = np.ones(n, dtype=bool)
    return [_sets({m: (residual[m][s], S[m], used) for m in SENSORS}) for s in range(seeds)]


def _gated(measured, told_R, told_Q, gate):
    seeds, n, _ = measured["position"].shape
    out = []
    for s in range(seeds):
        at, P = np.zeros(2), np.zeros((2, 2))
        seen = {name: ([], [], []) for name in SENSORS}
        for k in range(n):
            at, P = kalman.predict(at, P, np.zeros(2), told_Q * Q)
            for name, (H, R, _) in SENSORS.items():
                R = told_R * R if name == "range" else R
                step = kalman.correct(at, P, measured[name][s, k] - H @ at, H, R)
                nis = step.innovation @ np.linalg.solve(step.S, step.innovation)
                used = name != "range" or nis <= gate
                at, P = (step.x, step.P) if used else (at, P)
                for column, value in zip(seen[name], (step.innovation, step.S, used), strict=True):
                    column.append(value)
        out.append(_sets({name: [np.array(c) for c in columns] for name, columns in seen.items()}))
    return out


def _sets(columns):
    t_ns = np.arange(len(columns["range"][0]), dtype=np.int64) * STEP_NS
    return tuple(Innovations(m, t_ns, *columns[m], SENSORS[m][2]) for m in SENSORS)
