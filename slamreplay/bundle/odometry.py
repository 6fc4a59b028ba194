"""Where odometry says the robot was, whichever way the log says it."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import planar_from_ros


def odometry_track(view: BundleView) -> PoseTrack | None:
    """The base frame in the odom frame at every odometry sample, or None without odometry.

    From tf where the log has odom -> base on it, for that is what a localizer reads; else from the
    odometry topic. The covariance is the topic's where the poses are. Worked out once for all views
    that have it as recorded.
    """
    track = view.shared("odometry by tf", ["transforms"], _tf_track)
    if track is not None:
        return track
    return view.shared("odometry by topic", ["odometry", "transforms"], _topic_track)


def odometry_tables(view: BundleView) -> list[str]:
    """Names of the tables that the odometry depends on."""
    if view.shared("odometry by tf", ["transforms"], _tf_track) is not None:
        return ["transforms"]
    return ["odometry", "transforms"]


def _tf_track(view: BundleView) -> PoseTrack | None:
    frames = view.manifest.frames
    if frames.odom and frames.base and view.transforms.has_path(frames.odom, frames.base):
        path = view.transforms.path(frames.odom, frames.base)
        moving = [edge for edge in path if not edge.is_static]
        if moving:
            t_ns = max(moving, key=lambda edge: len(edge.t_ns)).t_ns
            T, valid = view.transforms.lookup(frames.odom, frames.base, t_ns)
            xyyaw = se3.planar(T[valid])
            keep = np.isfinite(xyyaw).all(axis=1)
            return PoseTrack.without_covariance(
                frames.odom, frames.base, t_ns[valid][keep], xyyaw[keep]
            )
    return None


def _topic_track(view: BundleView) -> PoseTrack | None:
    table = view.role("odometry")
    return None if table is None or not len(table) else topic_track(view, table)


def topic_track(view: BundleView, table: Table) -> PoseTrack:
    """The base by the rows of one topic of table odometry, sorted by time."""
    frames = view.manifest.frames
    yaw = se3.yaw_from_quaternion(table["orientation_xyzw"])
    xyyaw = np.column_stack([table["position_xyz"][:, :2], yaw])
    child = str(table["child_frame_id"][0])
    if frames.base and child != frames.base and view.transforms.has_path(child, frames.base):
        T_child_base, valid = view.transforms.lookup(child, frames.base, table.t_ns)
        xyyaw = se2.compose(xyyaw, se3.planar(T_child_base))
        xyyaw[~valid] = np.nan
    order = np.argsort(table.t_ns, kind="stable")
    order = order[np.isfinite(xyyaw[order]).all(axis=1)]
    # Equal stamps would make the motion between them ambiguous: the last message holds.
    t_ns = table.t_ns[order]
    order = order[np.append(t_ns[1:] != t_ns[:-1], True)] if len(order) else order
    cov = planar_from_ros(table["pose_covariance"])
    name = str(table["frame_id"][0]) or "odom"
    return PoseTrack(name, frames.base or child, table.t_ns[order], xyyaw[order], cov[order])
