"""Errors of a belief in space against a reference in space.

e = (position difference, rotation vector of R_hat R_ref') about the parent's axes, in ROS's order
x y z rx ry rz: a covariance in geometry_msgs is about fixed axes of the parent frame. It is the
first order of the error: rotations that are off by more than some 0.3 rad are only alike. Nothing
is aligned first.

A belief is taken for one in space where it says so itself: height, roll and pitch of its poses
are no constants, its 6x6 covariances are positive definite, and their variances of height, roll and
pitch neither stand for "not measured" nor are constants (`SpatialTrack.claims_space`). Filters in a
plane publish zeros or one small number there. The reference must leave the plane as well.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.published import update_rows
from slamreplay.consistency.evidence.spatial_track import SpatialTrack
from slamreplay.geometry import se3
from slamreplay.geometry.covariance import ANY_ANGLE, planar_from_ros
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.transforms import clean_frame


def spatial_belief(view: BundleView, updates: PoseTrack) -> SpatialTrack | None:
    """The rows of a belief (N) in space.

    None where it is one in a plane, or where these rows are not those that were published.
    """
    table = update_rows(view)
    if table is None or not np.array_equal(table.t_ns, updates.t_ns):
        return None
    cov = table["covariance"].reshape(-1, 6, 6)
    if not np.array_equal(planar_from_ros(cov), updates.cov, equal_nan=True):
        return None
    frames = view.manifest.frames
    T = se3.matrix(table["position_xyz"], table["orientation_xyzw"])
    track = SpatialTrack(updates.frame_id, table.t_ns, T, cov)
    if not (track.leaves_plane and track.claims_space):
        return None
    child = clean_frame(str(table["child_frame_id"][0]))
    base = frames.base or child
    if child and child != base and view.transforms.has_path(child, base):
        step, known = view.transforms.lookup(child, base, table.t_ns)
        track = track.mounted(np.where(known[:, None, None], step, np.nan))
    return track


def spatial_errors(
    belief: SpatialTrack, reference: SpatialTrack, max_gap_ns: int
) -> tuple[Array, Array]:
    """Errors (N, 6) at the belief's rows, and what is claimed for them (N, 6, 6).

    The reference is interpolated between samples no farther apart than `max_gap_ns`, and its
    covariance is added where it is finite. NaN where either is missing, and for rotations about
    which nothing is known (`ANY_ANGLE`).
    """
    truth = reference.at(belief.t_ns, max_gap_ns)
    turned = belief.T[:, :3, :3] @ np.swapaxes(truth.T[:, :3, :3], 1, 2)
    error = np.hstack([belief.T[:, :3, 3] - truth.T[:, :3, 3], se3.rotation_vector(turned)])
    variance = np.diagonal(belief.cov, axis1=1, axis2=2)[:, 3:]
    with np.errstate(invalid="ignore"):
        error[(variance > ANY_ANGLE).any(axis=1), 3:] = np.nan
    return error, belief.cov + np.where(np.isfinite(truth.cov), truth.cov, 0.0)
