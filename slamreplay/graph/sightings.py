"""What a chain of poses saw of things that stand still, as constraints of a planar pose graph."""

from __future__ import annotations

from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.covariance import gtsam_from_planar

#: What a survey of a landmark leaves: metres, metres, radians.
SURVEY = np.array([0.03, 0.03, 0.03])
#: Radians by which the heading of a position fix is not known, so that it says nothing.
_ANY_HEADING = 100.0


@dataclass(frozen=True, eq=False)
class Sightings:
    """M sightings of L landmarks that stand still.

    Attributes:
        pose_index: (M,) the pose that saw it.
        landmark: (M,) which one, 0 to L - 1.
        xyyaw: (M, 3) the landmark seen from that pose.
        cov: (M, 3, 3) in axes of that pose, m^2 and rad^2.
        initial: (L, 3) first guess of the landmarks, in the map.
        known: (L,) landmarks whose `initial` is a survey; the others are estimated freely.
    """

    pose_index: NDArray[np.int64]
    landmark: NDArray[np.int64]
    xyyaw: se2.Array
    cov: se2.Array
    initial: se2.Array
    known: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Fixes:
    """M positions measured in a frame whose place in the map is estimated with the poses.

    Attributes:
        pose_index: (M,) the pose that was measured.
        xyyaw: (M, 3) its position in that frame, and about which heading it had there.
        cov: (M, 2, 2) of the position in that frame's axes, m^2.
        initial: (3,) first guess of the frame in the map.
    """

    pose_index: NDArray[np.int64]
    xyyaw: se2.Array
    cov: se2.Array
    initial: se2.Array


def add_sightings(
    graph: gtsam.NonlinearFactorGraph,
    values: gtsam.Values,
    seen: Sightings,
    first_key: int,
    width: float,
) -> None:
    """Add landmarks under the keys from `first_key` on, and a robust constraint per sighting.

    Args:
        graph: constraints are added to it.
        values: holds the poses under 0, 1, ...; landmarks are added to it.
        seen: the sightings.
        first_key: key of landmark 0.
        width: Cauchy's width in standard deviations.
    """
    survey = gtsam.noiseModel.Diagonal.Sigmas(SURVEY)
    for j, pose in enumerate(seen.initial.tolist()):
        values.insert(first_key + j, gtsam.Pose2(*pose))
        if seen.known[j]:
            graph.add(gtsam.PriorFactorPose2(first_key + j, gtsam.Pose2(*pose), survey))
    body = gtsam_from_planar(seen.cov, seen.xyyaw[:, 2])
    for k, j, pose, cov in zip(
        seen.pose_index.tolist(), seen.landmark.tolist(), seen.xyyaw.tolist(), body, strict=True
    ):
        noise = robust(gtsam.noiseModel.Gaussian.Covariance(cov), width)
        graph.add(gtsam.BetweenFactorPose2(k, first_key + j, gtsam.Pose2(*pose), noise))


def add_fixes(
    graph: gtsam.NonlinearFactorGraph,
    values: gtsam.Values,
    fixes: Fixes,
    key: int,
    width: float,
) -> None:
    """Add the frame of the fixes under `key`, and a robust constraint per fix.

    A fix is a pose whose heading may be anything: gtsam measures its error in axes of the pose
    that was measured, so the position's covariance is turned into them.
    """
    values.insert(key, gtsam.Pose2(*fixes.initial.tolist()))
    cov = np.zeros((len(fixes.xyyaw), 3, 3))
    cov[:, :2, :2], cov[:, 2, 2] = fixes.cov, _ANY_HEADING**2
    body = gtsam_from_planar(cov, fixes.xyyaw[:, 2])
    for k, pose, one in zip(fixes.pose_index.tolist(), fixes.xyyaw.tolist(), body, strict=True):
        noise = robust(gtsam.noiseModel.Gaussian.Covariance(one), width)
        graph.add(gtsam.BetweenFactorPose2(key, k, gtsam.Pose2(*pose), noise))


def robust(noise: gtsam.noiseModel.Base, width: float) -> gtsam.noiseModel.Robust:
    """Noise of which Cauchy's weight gives up what lies far off (`width` sigmas count half)."""
    cauchy = gtsam.noiseModel.mEstimator.Cauchy.Create(width)
    return gtsam.noiseModel.Robust.Create(cauchy, noise)
