"""Planar pose graphs: a chain of measured motions, held to the map by robust constraints."""

from __future__ import annotations

import gtsam
import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.covariance import gtsam_from_planar, planar_from_gtsam
from slamreplay.graph.sightings import Fixes, Sightings, add_fixes, add_sightings, robust

#: Cauchy's width in standard deviations: a constraint that far off counts half.
CAUCHY_WIDTH = 1.5
#: What holds a stretch that no constraint reaches: metres, metres, radians.
_LOOSE = np.array([2.0, 2.0, 1.0])


def smooth_chain(
    initial: se2.Array,
    motions: se2.Array,
    motion_cov: se2.Array,
    is_open: NDArray[np.bool_],
    is_solid: NDArray[np.bool_],
    anchor_index: NDArray[np.int64],
    anchors: se2.Array,
    anchor_cov: se2.Array,
    seen: Sightings | None = None,
    fixes: Fixes | None = None,
) -> tuple[se2.Array, se2.Array]:
    """Poses (K, 3) that agree best with motions and anchors, and their marginal covariances.

    Args:
        initial: (K, 3) first guess.
        motions: (K - 1, 3) measured motion from each pose to the next.
        motion_cov: (K - 1, 3, 3) its covariance in axes of the earlier pose.
        is_open: (K - 1,) motions that are not known and make no constraint.
        is_solid: (K - 1,) motions that are beyond doubt; the others may be given up (Cauchy).
        anchor_index: (A,) which pose an anchor is for.
        anchors: (A, 3) poses measured against the map.
        anchor_cov: (A, 3, 3) their covariances about the map's axes.
        seen: landmarks that the poses saw; they are estimated too.
        fixes: positions in a frame of their own.

    Returns:
        Poses and covariances (K, 3, 3) of x y yaw about the map's axes.
    """
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k, pose in enumerate(initial.tolist()):
        values.insert(k, gtsam.Pose2(*pose))
    # gtsam's between factor measures its error in axes of the later pose.
    turned = gtsam_from_planar(motion_cov, motions[:, 2])
    for k in np.flatnonzero(~is_open).tolist():
        noise = gtsam.noiseModel.Gaussian.Covariance(turned[k])
        motion = gtsam.Pose2(*motions[k].tolist())
        trusted = noise if is_solid[k] else robust(noise, CAUCHY_WIDTH)
        graph.add(gtsam.BetweenFactorPose2(k, k + 1, motion, trusted))
    body_cov = gtsam_from_planar(anchor_cov, anchors[:, 2])
    for k, pose, cov in zip(anchor_index.tolist(), anchors.tolist(), body_cov, strict=True):
        noise = gtsam.noiseModel.Gaussian.Covariance(cov)
        graph.add(gtsam.PriorFactorPose2(k, gtsam.Pose2(*pose), robust(noise, CAUCHY_WIDTH)))
    n = len(initial)
    if seen is not None:
        add_sightings(graph, values, seen, n, CAUCHY_WIDTH)
    if fixes is not None:
        add_fixes(graph, values, fixes, n + (0 if seen is None else len(seen.initial)),
                  CAUCHY_WIDTH)  # fmt: skip
    loose = gtsam.noiseModel.Diagonal.Sigmas(_LOOSE)
    for k in [0, *(np.flatnonzero(is_open) + 1).tolist()]:
        graph.add(gtsam.PriorFactorPose2(k, gtsam.Pose2(*initial[k].tolist()), loose))
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    poses = gtsam.utilities.extractPose2(result).reshape(-1, 3)[:n]
    marginals = gtsam.Marginals(graph, result)
    body = np.array([marginals.marginalCovariance(k) for k in range(n)])
    poses[:, 2] = se2.wrap_angle(poses[:, 2])
    return poses, planar_from_gtsam(body, poses[:, 2])
