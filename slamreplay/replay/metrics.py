"""A run in a few numbers: how far it is from its baseline, and from a reference that judges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slamreplay.bundle.run import Run
from slamreplay.bundle.schema import JUDGING_KINDS
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2, se3
from slamreplay.geometry.alignment import least_squares
from slamreplay.geometry.covariance import planar_from_ros
from slamreplay.replay.relations import relation_metrics

#: Fewer are laid onto anything.
_LEAST_POSITIONS = 3

Metrics = dict[str, float | None]


def baseline_of(run: Run, runs: Sequence[Run]) -> Run | None:
    """The undisturbed run of the same estimator with the same parameters and seed."""
    undisturbed = replace(run.trial, perturbation=None, level=None, unit="")
    for other in runs:
        if other.trial == undisturbed:
            return other
    return None


def trial_metrics(run: Run, runs: Sequence[Run], bundle: Bundle) -> Metrics:
    """Numbers of one run beside its baseline among `runs`; None where a number does not exist.

    `rows` and `rows_with_pose`; `baseline_median_m`, `baseline_max_m`, `baseline_final_m` and
    `baseline_max_rad`: distance to the baseline at the same times; `reference_rmse_m`,
    `reference_max_m`, `reference_max_rad`: distance to a judging reference in the same frame,
    nothing aligned; `ate_aligned_m`: of positions, after laying the whole path rigidly onto the
    reference, whose frame may be its own (see `ate_aligned`); `relations_*` as in
    `replay.relations`.
    """
    track = None if run.estimate is None else run.estimate.track
    baseline = baseline_of(run, runs)
    beside = None if baseline is None or baseline.estimate is None else baseline.estimate.track
    to_baseline = _difference(track, beside)
    reference = judging_reference(bundle)
    to_reference = _difference(track, reference)
    distance, turn = np.hypot(to_baseline[:, 0], to_baseline[:, 1]), np.abs(to_baseline[:, 2])
    error = np.hypot(to_reference[:, 0], to_reference[:, 1])
    return {
        "rows": None if track is None else float(len(track)),
        "rows_with_pose": None if track is None else float(track.has_pose.sum()),
        "baseline_median_m": float(np.median(distance)) if len(distance) else None,
        "baseline_max_m": float(distance.max()) if len(distance) else None,
        "baseline_final_m": float(distance[-1]) if len(distance) else None,
        "baseline_max_rad": float(turn.max()) if len(turn) else None,
        "reference_rmse_m": float(np.sqrt(np.mean(error**2))) if len(error) else None,
        "reference_max_m": float(error.max()) if len(error) else None,
        "reference_max_rad": float(np.abs(to_reference[:, 2]).max()) if len(error) else None,
        "ate_aligned_m": ate_aligned(track, reference),
        **relation_metrics(track, bundle),
    }


def judging_reference(bundle: Bundle) -> PoseTrack | None:
    """The poses of the references that only judge, or None where the log has none."""
    table = bundle.table("references")
    return bundle.shared.of("judging reference", (), [table], lambda: _judging(table))


def _judging(table: Table) -> PoseTrack | None:
    table = table.take(np.isin(table["kind"].astype(str), sorted(JUDGING_KINDS)))
    if not len(table):
        return None
    table = table.take(table["topic"] == table["topic"][0]).sorted_by_time()
    yaw = se3.yaw_from_quaternion(table["orientation_xyzw"])
    xyyaw = np.column_stack([table["position_xyz"][:, :2], yaw])
    cov = planar_from_ros(table["covariance"])
    frame, child = str(table["frame_id"][0]), str(table["child_frame_id"][0])
    return PoseTrack(frame, child, table.t_ns, xyyaw, cov)


def ate_aligned(track: PoseTrack | None, reference: PoseTrack | None) -> float | None:
    """Absolute trajectory error in m: rms distance of positions, the path rigidly laid on first.

    As the TUM benchmark has it (Sturm et al., IROS 2012) and evo prints it with `--align`. It tells
    the shape of a path apart from the frame it is in, and says nothing of a covariance: an
    alignment eats the error that NEES is about. None below three common positions.

    Args:
        track: the path.
        reference: in any frame; it is interpolated at the path's times.
    """
    if track is None or reference is None:
        return None
    # A reference of positions alone has them interpolated all the same.
    xyyaw = np.column_stack([reference.xyyaw[:, :2], np.nan_to_num(reference.xyyaw[:, 2])])
    placed = replace(reference, xyyaw=xyyaw)
    onto, points = placed.at(track.t_ns).xyyaw[:, :2], track.xyyaw[:, :2]
    both = np.isfinite(onto).all(axis=1) & np.isfinite(points).all(axis=1)
    if both.sum() < _LEAST_POSITIONS:
        return None
    points, onto = points[both], onto[both]
    apart = se2.transform_points(least_squares(points, onto), points) - onto
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def _difference(track: PoseTrack | None, other: PoseTrack | None) -> se2.Array:
    """(M, 3) x y in the parent's axes and wrapped yaw, where both have a pose."""
    if track is None or other is None or track.frame_id != other.frame_id:
        return np.empty((0, 3))
    difference = track.xyyaw - other.at(track.t_ns).xyyaw
    difference[:, 2] = se2.wrap_angle(difference[:, 2])
    return np.asarray(difference[np.isfinite(difference).all(axis=1)])
