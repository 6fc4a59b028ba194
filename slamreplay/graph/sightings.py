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
#: A point that is seen nearer than this has no bearing, m.
_NEAREST_M = 0.01
#: Radians by which the heading of a position fix is not known, so that it says nothing.
_ANY_HEADING = 100.0


@dataclass(frozen=True, eq=False)
class Sightings:
    """M sightings of L landmarks that stand still.

    Attributes:
        pose_index: (M,) the pose that saw it.
        landmark: (M,) which one, 0 to L - 1.
        xyyaw: (M, 3) the landmark seen from that pose; a heading of NaN was not sensed.
        cov: (M, 3, 3) in axes of that pose, m^2 and rad^2.
        initial: (L, 3) first guess of the landmarks, in the map; with a heading of NaN the landmark
            is a point, and only where it was seen counts.
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
    is_point = np.isnan(seen.initial[:, 2])
    _add_points(graph, values, seen, is_point, first_key, width)
    survey = gtsam.noiseModel.Diagonal.Sigmas(SURVEY)
    for j in np.flatnonzero(~is_point).tolist():
        pose = gtsam.Pose2(*seen.initial[j].tolist())
        values.insert(first_key + j, pose)
        if seen.known[j]:
            graph.add(gtsam.PriorFactorPose2(first_key + j, pose, survey))
    rows = np.flatnonzero(~is_point[seen.landmark])
    body = gtsam_from_planar(seen.cov[rows], seen.xyyaw[rows, 2])
    for k, j, xyyaw, cov in zip(
        seen.pose_index[rows].tolist(), seen.landmark[rows].tolist(), seen.xyyaw[rows].tolist(),
        body, strict=True,
    ):  # fmt: skip
        noise = robust(gtsam.noiseModel.Gaussian.Covariance(cov), width)
        graph.add(gtsam.BetweenFactorPose2(k, first_key + j, gtsam.Pose2(*xyyaw), noise))


def _add_points(
    graph: gtsam.NonlinearFactorGraph,
    values: gtsam.Values,
    seen: Sightings,
    is_point: NDArray[np.bool_],
    first_key: int,
    width: float,
) -> None:
    """Landmarks (of L those under the mask) that are points, each seen at a bearing and a range."""
    survey = gtsam.noiseModel.Diagonal.Sigmas(SURVEY[:2])
    for j in np.flatnonzero(is_point).tolist():
        values.insert(first_key + j, seen.initial[j, :2].copy())
        if seen.known[j]:
            graph.add(gtsam.PriorFactorPoint2(first_key + j, seen.initial[j, :2].copy(), survey))
    x, y = seen.xyyaw[:, 0], seen.xyyaw[:, 1]
    reach, bearing = np.maximum(np.hypot(x, y), _NEAREST_M), np.arctan2(y, x)
    across = np.stack([-np.sin(bearing), np.cos(bearing)], axis=-1) / reach[:, None]
    along = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    J = np.stack([across, along], axis=-2)  # of bearing and range by x and y
    polar = J @ seen.cov[:, :2, :2] @ np.swapaxes(J, 1, 2)
    for m in np.flatnonzero(is_point[seen.landmark]).tolist():
        noise = robust(gtsam.noiseModel.Gaussian.Covariance(polar[m]), width)
        keys = int(seen.pose_index[m]), first_key + int(seen.landmark[m])
        direction = gtsam.Rot2.fromAngle(float(bearing[m]))
        graph.add(gtsam.BearingRangeFactor2D(*keys, direction, float(reach[m]), noise))


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
