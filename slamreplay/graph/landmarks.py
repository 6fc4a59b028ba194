"""Poses and point landmarks from motions and sightings: both together, or one taken as exact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import gtsam
import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.covariance import gtsam_from_planar, planar_from_gtsam

#: What is taken as exact is held to this, m and rad: far below what any sensor can tell.
_EXACT = 1e-5


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a robot measured on its way.

    Attributes:
        motions: (K - 1, 3) from each pose to the next.
        motion_cov: (K - 1, 3, 3) in axes of the earlier pose.
        pose_index: (M,) the pose that saw a landmark.
        landmark: (M,) which one, 0 to L - 1; every one is seen at least once.
        bearing: (M,) in axes of the pose, rad.
        reach: (M,) its distance, m.
        bearing_sigma: rad.
        range_sigma_m: m.
    """

    motions: se2.Array
    motion_cov: se2.Array
    pose_index: NDArray[np.int64]
    landmark: NDArray[np.int64]
    bearing: se2.Array
    reach: se2.Array
    bearing_sigma: float
    range_sigma_m: float


@dataclass(frozen=True, eq=False)
class Posterior:
    """Poses (K, 3) with covariances (K, 3, 3) about the map's axes, landmarks (L, 2), (L, 2, 2)."""

    xyyaw: se2.Array
    cov: se2.Array
    landmarks: se2.Array
    landmark_cov: se2.Array


def most_probable(
    evidence: Evidence,
    xyyaw: se2.Array,
    landmarks: se2.Array,
    exact: Literal["", "poses", "landmarks"] = "",
) -> Posterior:
    """The maximum of p(poses, landmarks | evidence) and its marginal covariances.

    Args:
        evidence: what was measured, all of it honest: no constraint is robust.
        xyyaw: (K, 3) first guess of the poses; the first one is where the map's frame is.
        landmarks: (L, 2) first guess.
        exact: what is not estimated but taken as it is given. With "poses" the landmarks come from
            the sightings alone, with "landmarks" the poses from motions and sightings.

    Returns:
        Estimates; what was taken as exact has (nearly) no covariance, which is the fault of it.
    """
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    count = len(xyyaw)
    held = gtsam.noiseModel.Isotropic
    for k, pose in enumerate(xyyaw.tolist()):
        values.insert(k, gtsam.Pose2(*pose))
        if k == 0 or exact == "poses":
            graph.add(gtsam.PriorFactorPose2(k, gtsam.Pose2(*pose), held.Sigma(3, _EXACT)))
    for j, point in enumerate(landmarks):
        values.insert(count + j, point.copy())
        if exact == "landmarks":
            graph.add(gtsam.PriorFactorPoint2(count + j, point.copy(), held.Sigma(2, _EXACT)))
    if exact != "poses":
        # gtsam's between factor measures its error in axes of the later pose.
        turned = gtsam_from_planar(evidence.motion_cov, evidence.motions[:, 2])
        for k, (motion, cov) in enumerate(zip(evidence.motions.tolist(), turned, strict=True)):
            noise = gtsam.noiseModel.Gaussian.Covariance(cov)
            graph.add(gtsam.BetweenFactorPose2(k, k + 1, gtsam.Pose2(*motion), noise))
    sigmas = np.array([evidence.bearing_sigma, evidence.range_sigma_m])
    seen = gtsam.noiseModel.Diagonal.Sigmas(sigmas)
    for k, j, bearing, reach in zip(
        evidence.pose_index.tolist(), evidence.landmark.tolist(), evidence.bearing.tolist(),
        evidence.reach.tolist(), strict=True,
    ):  # fmt: skip
        direction = gtsam.Rot2.fromAngle(bearing)
        graph.add(gtsam.BearingRangeFactor2D(k, count + j, direction, reach, seen))
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    marginals = gtsam.Marginals(graph, found)
    poses = gtsam.utilities.extractPose2(found).reshape(-1, 3)
    points = gtsam.utilities.extractPoint2(found).reshape(-1, 2)
    body = np.array([marginals.marginalCovariance(k) for k in range(count)])
    spread = np.array([marginals.marginalCovariance(count + j) for j in range(len(points))])
    return Posterior(poses, planar_from_gtsam(body, poses[:, 2]), points, spread)
