"""Many runs down one corridor: a Kalman filter, one loop closure at the end, and a smoother.

The state is the robot's x along and y across the corridor, and beside them the x and y of its first
pose: a closure measures the last pose relative to the first, and a filter can only take that in
while it still carries both ("stochastic cloning", Roumeliotis and Burdick, ICRA 2002). The heading
is known, as with a good gyro; so all is linear and the filter is optimal where its noises are true.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from slamreplay.estimators.kalman import correct, predict
from slamreplay.estimators.smoother import smooth
from slamreplay.geometry.se2 import Array

Wall = Literal["side", "end"]

#: The end wall stands a step's width behind the last pose; where exactly changes no covariance.
_BEHIND_M = 1.0


@dataclass(frozen=True)
class Corridor:
    """The drive, and what is sensed on it.

    Attributes:
        steps: how many.
        step_m: along the corridor, each.
        width_m: between the side walls; the robot drives in the middle.
        start_sigma_m: of the first belief, along and across.
        range_sigma_m: of a range to a wall.
        closure_sigma_m: of the closure, along and across.
    """

    steps: int
    step_m: float
    width_m: float
    start_sigma_m: float
    range_sigma_m: float
    closure_sigma_m: float

    def truth(self) -> Array:
        """(K + 1, 2) where the robot is, m."""
        x = self.step_m * np.arange(self.steps + 1)
        return np.column_stack([x, np.zeros_like(x)])


@dataclass(frozen=True, eq=False)
class Chain:
    """Beliefs along the corridor.

    Attributes:
        error: (K + 1, runs, 2) estimate minus truth, m.
        P: (K + 1, 2, 2) covariance that every run claims, m2.
    """

    error: Array
    P: Array

    def nees(self) -> Array:
        """(K + 1, runs) e' P^-1 e of two degrees of freedom."""
        return np.array([squared(e, P) for e, P in zip(self.error, self.P, strict=True)])


@dataclass(frozen=True, eq=False)
class Drive:
    """What many runs of one filter believed.

    Attributes:
        filtered: at every step, with what was known then.
        smoothed: looking back from the end, without the closure.
        closed: looking back from the end, with the closure.
        closure_nis: (runs,) innovation of the closure, squared in its own covariance: two degrees
            of freedom.
    """

    filtered: Chain
    smoothed: Chain
    closed: Chain
    closure_nis: Array


def drive(
    corridor: Corridor,
    told_m2: Array,
    true_m2: Array,
    every_steps: int | None,
    walls: tuple[Wall, ...],
    runs: int,
    rng: np.random.Generator,
) -> Drive:
    """Drive down the corridor, close the loop, and look back.

    Args:
        corridor: the drive.
        told_m2: (2,) variance of a step along and across, as the filter has it.
        true_m2: (2,) the variance with which odometry errs.
        every_steps: ranges are taken in at every so many steps; None: never.
        walls: whose range: a side wall tells y, the end wall tells x.
        runs: how many, each with noise of its own.
        rng: of all noise.
    """
    truth = corridor.truth()
    R = np.eye(len(walls)) * corridor.range_sigma_m**2
    H = np.array([[0.0, -1.0, 0.0, 0.0] if w == "side" else [-1.0, 0.0, 0.0, 0.0] for w in walls])
    at_zero = np.array(
        [corridor.width_m / 2 if w == "side" else truth[-1, 0] + _BEHIND_M for w in walls]
    )
    Q = np.diag([*told_m2, 0.0, 0.0])
    start = truth[0] + rng.normal(0.0, corridor.start_sigma_m, (runs, 2))
    X, P = np.hstack([start, start]), np.tile(np.eye(2) * corridor.start_sigma_m**2, (2, 2))
    x_all, P_all, x_prior, P_prior = [X], [P], [X], [P]
    for k in range(1, corridor.steps + 1):
        odometry = truth[k] - truth[k - 1] + rng.normal(0.0, np.sqrt(true_m2), (runs, 2))
        X = X + np.hstack([odometry, np.zeros((runs, 2))])
        P = predict(np.zeros(4), P, np.zeros(4), Q)[1]
        x_prior.append(X)
        P_prior.append(P)
        if every_steps and k % every_steps == 0 and walls:
            z = at_zero + H[:, :2] @ truth[k] + rng.normal(0.0, corridor.range_sigma_m,
                                                           (runs, len(walls)))  # fmt: skip
            X, P, _ = _corrected(X, P, z - at_zero - X @ H.T, H, R)
        x_all.append(X)
        P_all.append(P)
    priors = np.array(x_prior), np.array(P_prior)
    filtered = np.array(x_all), np.array(P_all)
    smoothed = smooth(*filtered, *priors)
    relative = np.hstack([np.eye(2), -np.eye(2)])
    z = truth[-1] - truth[0] + rng.normal(0.0, corridor.closure_sigma_m, (runs, 2))
    closure = np.eye(2) * corridor.closure_sigma_m**2
    X, P, nis = _corrected(X, P, z - X @ relative.T, relative, closure)
    closed = smooth(np.array([*x_all[:-1], X]), np.array([*P_all[:-1], P]), *priors)

    def chain(x: Array, P: Array) -> Chain:
        return Chain(x[..., :2] - truth[:, None], P[:, :2, :2])

    return Drive(chain(*filtered), chain(*smoothed), chain(*closed), nis)


def squared(e: Array, P: Array) -> Array:
    """(runs,) e' P^-1 e of errors (runs, n) with one covariance (n, n)."""
    return np.sum(np.linalg.solve(np.linalg.cholesky(P), e.T) ** 2, axis=0)


def _corrected(
    X: Array, P: Array, innovation: Array, H: Array, R: Array
) -> tuple[Array, Array, Array]:
    """States (runs, n) and their covariance after a measurement, and its squared innovations.

    The gain does not depend on what was measured: it is found once for all runs.
    """
    step = correct(np.zeros(len(P)), P, np.zeros(len(R)), H, R)
    return X + innovation @ step.gain.T, step.P, squared(innovation, step.S)
