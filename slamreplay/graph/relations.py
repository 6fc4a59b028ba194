"""Relations between poses of the plane, and the poses that agree best with all of them."""

from __future__ import annotations

from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.covariance import gtsam_from_planar, planar_from_gtsam, turned
from slamreplay.graph.marginals import marginal_covariances

#: A start that is certain is held to this, m and rad: less would only cost digits.
_LEAST_SIGMA = 1e-4
#: The optimum is near enough where a step gains less than this share of the error.
_ENOUGH = 1e-5
#: By how much the scaling of doubtful relations is narrowed at a time, and how often at the most.
_NARROWER, _MOST_STEPS = 10.0, 6


@dataclass(frozen=True, eq=False)
class Relations:
    """E measured poses of one node seen from another.

    Attributes:
        pairs: (E, 2) the node it is seen from, and the node that is seen.
        xyyaw: (E, 3) measured pose of the second in the first, m, m, rad.
        cov: (E, 3, 3) about axes of the first, m^2 and rad^2.
    """

    pairs: NDArray[np.int64]
    xyyaw: se2.Array
    cov: se2.Array

    def __len__(self) -> int:
        return len(self.pairs)

    @classmethod
    def none(cls) -> Relations:
        """No relation at all."""
        return cls(np.empty((0, 2), dtype=np.int64), np.empty((0, 3)), np.empty((0, 3, 3)))

    def residuals(self, poses: se2.Array) -> se2.Array:
        """(E, 3) measured minus what poses (N, 3) say, along axes of the first, yaw wrapped."""
        off = self.xyyaw - se2.between(poses[self.pairs[:, 0]], poses[self.pairs[:, 1]])
        off[:, 2] = se2.wrap_angle(off[:, 2])
        return np.asarray(off)

    def chi2(self, poses: se2.Array) -> se2.Array:
        """(E,) squared residuals in units of the covariance: r' R^-1 r."""
        L = np.linalg.cholesky(self.cov)
        white = np.linalg.solve(L, self.residuals(poses)[..., None])[..., 0]
        return np.asarray((white**2).sum(axis=1))

    def switches(self, poses: se2.Array, phi: float) -> se2.Array:
        """(E,) how far each is switched on at poses (N, 3), 1 for wholly.

        The closed form of Sunderhauf and Protzel's switchable constraints (Agarwal, Tipaldi,
        Spinello, Stachniss, Burgard, Robust map optimization using dynamic covariance scaling,
        ICRA 2013, eq. 15): min(1, 2 phi / (phi + chi2)).
        """
        return np.asarray(np.minimum(1.0, 2.0 * phi / (phi + self.chi2(poses))))


@dataclass(frozen=True, eq=False)
class Solution:
    """Poses that agree best with relations.

    Attributes:
        xyyaw: (N, 3).
        cov: (N, 3, 3) marginal covariances about the parent's axes; NaN where not asked for.
    """

    xyyaw: se2.Array
    cov: se2.Array


def solved(
    initial: se2.Array,
    first_cov: se2.Array,
    firm: Relations,
    doubtful: Relations | None = None,
    phi: float | None = None,
    with_cov: bool = False,
    most_steps: int = _MOST_STEPS,
) -> Solution:
    """Optimise poses by Levenberg and Marquardt's method.

    Args:
        initial: (N, 3) first guess; the first pose is held there.
        first_cov: (3, 3) how well that one is known, about the parent's axes.
        firm: relations that are beyond doubt.
        doubtful: relations that may be wrong,
        phi: and this parameter of their dynamic covariance scaling: one of a larger chi-square is
            switched off gradually. None takes them as firm.
        with_cov: whether covariances are worked out.
        most_steps: how many wider scalings come before that one: fewer where the guess is near.
    """
    doubtful = Relations.none() if doubtful is None else doubtful
    held = [prior(initial[0], first_cov), *factors_of(firm)]
    xyyaw = initial
    for width in _widths(doubtful, initial, phi, most_steps):
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for k, pose in enumerate(xyyaw.tolist()):
            values.insert(k, gtsam.Pose2(*pose))
        for factor in (*held, *factors_of(doubtful, width)):
            graph.add(factor)
        rules = gtsam.LevenbergMarquardtParams()
        rules.setRelativeErrorTol(_ENOUGH)
        result = gtsam.LevenbergMarquardtOptimizer(graph, values, rules).optimize()
        xyyaw = gtsam.utilities.extractPose2(result).reshape(-1, 3)
        xyyaw[:, 2] = se2.wrap_angle(xyyaw[:, 2])
    cov = np.full((len(xyyaw), 3, 3), np.nan)
    if with_cov:
        body, _ = marginal_covariances(graph, result)
        cov = planar_from_gtsam(body, xyyaw[:, 2])
        cov = (cov + np.swapaxes(cov, 1, 2)) / 2.0
    return Solution(xyyaw, cov)


def _widths(
    doubtful: Relations, initial: se2.Array, phi: float | None, most_steps: int
) -> list[float | None]:
    """Parameters of one optimisation after the other.

    Where drift has put a first guess far off, a narrow scaling would switch off what is true. So it
    begins as wide as the largest residual and is narrowed step by step (graduated non-convexity:
    Yang, Antonante, Tzoumas, Carlone, RA-L 2020), each time from where the last one ended.
    """
    if phi is None or not len(doubtful):
        return [None]
    largest = float(doubtful.chi2(initial).max())
    steps = int(np.ceil(np.log(max(largest / phi, 1.0)) / np.log(_NARROWER)))
    return [phi * _NARROWER**k for k in range(min(steps, most_steps), -1, -1)]


def prior(xyyaw: se2.Array, cov: se2.Array, key: int = 0) -> gtsam.NonlinearFactor:
    """What holds pose `key` at (3,), with covariance (3, 3) about the parent's axes."""
    body = gtsam_from_planar(cov, xyyaw[2]) + np.eye(3) * _LEAST_SIGMA**2
    noise = gtsam.noiseModel.Gaussian.Covariance(body)
    return gtsam.PriorFactorPose2(key, gtsam.Pose2(*xyyaw.tolist()), noise)


def factors_of(relations: Relations, phi: float | None = None) -> list[gtsam.NonlinearFactor]:
    """A factor for each relation, scaled by its residual where `phi` is told."""
    # gtsam's between factor measures its error in axes of the later pose.
    body = gtsam_from_planar(relations.cov, relations.xyyaw[:, 2])
    scaling = None if phi is None else gtsam.noiseModel.mEstimator.DCS.Create(phi)
    out: list[gtsam.NonlinearFactor] = []
    for (i, j), pose, cov in zip(
        relations.pairs.tolist(), relations.xyyaw.tolist(), body, strict=True
    ):
        noise: gtsam.noiseModel.Base = gtsam.noiseModel.Gaussian.Covariance(cov)
        if scaling is not None:
            noise = gtsam.noiseModel.Robust.Create(scaling, noise)
        out.append(gtsam.BetweenFactorPose2(i, j, gtsam.Pose2(*pose), noise))
    return out


def relative_covariance(
    xyyaw_i: se2.Array, xyyaw_j: se2.Array, cov_i: se2.Array, cov_j: se2.Array, cov_ij: se2.Array
) -> se2.Array:
    """Covariance (3, 3) of T_i_j about axes of i, from gtsam's joint covariance of both poses.

    Args:
        xyyaw_i: (3,).
        xyyaw_j: (3,).
        cov_i: (3, 3) of pose i about its own axes.
        cov_j: (3, 3) of pose j about its own axes.
        cov_ij: (3, 3) of the error of i with that of j.
    """
    T_i_j = se2.between(xyyaw_i, xyyaw_j)
    x, y, yaw = T_i_j
    # In axes of i: an error of j itself, less what the error of i does to it.
    by_i = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1.0]])
    both = by_i @ cov_ij @ turn.T
    cov = turned(cov_j, yaw) + by_i @ cov_i @ by_i.T - both - both.T
    return np.asarray((cov + cov.T) / 2.0)
