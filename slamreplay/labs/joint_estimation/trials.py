"""The same evidence estimated three ways, and how far off each is of what it claims."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.geometry import se2
from slamreplay.graph.landmarks import Posterior, most_probable
from slamreplay.labs.joint_estimation.drive import Drive
from slamreplay.labs.joint_estimation.sequence import map_then_localise, step_by_step

#: Degrees of freedom of a pose.
DOF = 3
MAP_FIRST, BY_STEPS, JOINT = "map first, then localize", "step by step", "jointly"
WAYS = (MAP_FIRST, BY_STEPS, JOINT)


@dataclass(frozen=True, eq=False)
class Trial:
    """One way of estimating one log; the first pose, which is given, left out.

    Attributes:
        estimate: what came out.
        error_m: (K - 1,) of the position.
        sigma_m: (K - 1,) root of the summed variances claimed for it.
        nees: (K - 1,) squared error of x, y and yaw in the claimed covariance.
        map_error_m: root mean square over the landmarks.
    """

    estimate: Posterior
    error_m: se2.Array
    sigma_m: se2.Array
    nees: se2.Array
    map_error_m: float


def estimated(driven: Drive) -> dict[str, Trial]:
    """Every way by its name."""
    evidence, odometry = driven.evidence, driven.odometry
    first = map_then_localise(evidence, odometry)
    steps = step_by_step(evidence, odometry[0])
    # The optimum is one; a better first guess only finds it sooner.
    joint = most_probable(evidence, steps.xyyaw, steps.landmarks)
    found = {MAP_FIRST: first, BY_STEPS: steps, JOINT: joint}
    return {name: _judged(posterior, driven) for name, posterior in found.items()}


def odometry_error_m(driven: Drive) -> se2.Array:
    """(K - 1,) how far odometry alone is off."""
    return np.asarray(np.hypot(*(driven.odometry - driven.xyyaw)[1:, :2].T))


def _judged(found: Posterior, driven: Drive) -> Trial:
    off = (found.xyyaw - driven.xyyaw)[1:]
    off[:, 2] = se2.wrap_angle(off[:, 2])
    L = np.linalg.cholesky(found.cov[1:])
    white = np.linalg.solve(L, off[..., None])[..., 0]
    return Trial(
        found,
        np.hypot(off[:, 0], off[:, 1]),
        np.sqrt(np.trace(found.cov[1:, :2, :2], axis1=1, axis2=2)),
        (white**2).sum(axis=1),
        float(np.sqrt(np.mean(np.sum((found.landmarks - driven.landmarks) ** 2, axis=1)))),
    )
