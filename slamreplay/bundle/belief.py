"""What the robot believed at any time: the localizer as the planner would have read it."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import planar_from_ros

#: Where a localizer speaks: the transform between map and odometry, or a topic of poses.
By = Literal["tf", "pose"]


def recorded_belief(
    view: BundleView, t_ns: NDArray[np.int64], *, by: By | None = None
) -> PoseTrack | None:
    """The robot's own belief at times (M,), base in map, or None where no localizer spoke.

    The latest map->odom that had arrived, composed with odom->base at t; without it the latest
    pose of the localizer, carried by odometry (held, where there is none). Rows before the first
    correction are NaN. The covariance is the latest published one; NaN where none is.

    Args:
        view: the log.
        t_ns: (M,) times.
        by: one of the two alone; by default as a planner reads it, tf before poses.
    """
    t_ns = np.asarray(t_ns, dtype=np.int64)
    odometry = odometry_track(view)
    xyyaw = None if by == "pose" else _from_transforms(view, odometry, t_ns)
    poses, poses_cov = _latest_pose(view, odometry, t_ns)
    if xyyaw is None and by != "tf":
        xyyaw = poses
    if xyyaw is None:
        return None
    cov = np.full((len(t_ns), 3, 3), np.nan) if poses_cov is None else poses_cov
    frames = view.manifest.frames
    return PoseTrack(frames.map or "map", frames.base or "base_link", t_ns, xyyaw, cov)


def belief_times(view: BundleView) -> NDArray[np.int64]:
    """(N,) sorted times at which the belief is asked for: scans, else odometry, else poses."""
    for role in ("scan", "odometry", "pose"):
        table = view.role(role)
        if table is not None and len(table):
            return np.sort(table.t_ns)
    track = odometry_track(view)
    return np.zeros(0, dtype=np.int64) if track is None else np.sort(track.t_ns)


def spoken_ns(view: BundleView, by: By) -> NDArray[np.int64]:
    """(K,) sorted times at which a word of the localizer arrived that was not the one before.

    On tf one and the same transform is told again and again between two updates.
    """
    if by == "pose":
        table = view.role("pose")
        return np.unique(_pose_arrival(view, table)) if table is not None else _NEVER
    told = _told_corrections(view)
    if told is None:
        return _NEVER
    arrived, correction = told
    is_new = np.append(True, (correction[1:] != correction[:-1]).any(axis=1))
    return np.unique(arrived[is_new & (arrived > np.iinfo(np.int64).min)])


def arrival_ns(view: BundleView, t_log_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """When messages arrived, on the bundle's clock.

    AMCL stamps map->odom with the scan's time plus a tolerance, so a localizer's stamps do not say
    from when on its answer could be used; the recorder's times do.
    """
    return view.manifest.clock.from_log_time(t_log_ns)


def _from_transforms(
    view: BundleView, odometry: PoseTrack | None, t_ns: NDArray[np.int64]
) -> se2.Array | None:
    told = _told_corrections(view)
    if told is None or odometry is None:
        return None
    arrived, correction = told
    latest = np.searchsorted(arrived, t_ns, side="right") - 1
    xyyaw = se2.compose(correction[np.maximum(latest, 0)], odometry.at(t_ns).xyyaw)
    xyyaw[latest < 0] = np.nan
    return xyyaw


def _told_corrections(view: BundleView) -> tuple[NDArray[np.int64], se2.Array] | None:
    """When each map->odom arrived (K,), and odom in map (K, 3), in order of arrival."""
    frames = view.manifest.frames
    if not (frames.map and frames.odom):
        return None
    table = view.table("transforms")
    parents, children = table["parent_frame"], table["child_frame"]
    down = (parents == frames.map) & (children == frames.odom)
    up = (parents == frames.odom) & (children == frames.map)
    rows = np.flatnonzero(down | up)
    if not len(rows):
        return None
    arrived = arrival_ns(view, table["t_log_ns"][rows])
    if table["is_static"][rows].all():
        arrived = np.full(len(rows), np.iinfo(np.int64).min)  # holds at all times
    order = np.argsort(arrived, kind="stable")
    rows, arrived = rows[order], arrived[order]
    T = se3.matrix(table["translation_xyz"][rows], table["rotation_xyzw"][rows])
    correction = se3.planar(T)
    correction[up[rows]] = se2.inverse(correction[up[rows]])
    return arrived, correction


def _latest_pose(
    view: BundleView, odometry: PoseTrack | None, t_ns: NDArray[np.int64]
) -> tuple[se2.Array | None, se2.Array | None]:
    table = view.role("pose")
    if table is None or not len(table):
        return None, None
    arrived = _pose_arrival(view, table)
    order = np.argsort(arrived, kind="stable")
    table, arrived = table.take(order), arrived[order]
    latest = np.searchsorted(arrived, t_ns, side="right") - 1
    known = np.maximum(latest, 0)
    yaw = se3.yaw_from_quaternion(table["orientation_xyzw"])
    xyyaw = np.column_stack([table["position_xyz"][:, :2], yaw])[known]
    if odometry is not None and len(odometry):
        moved = se2.between(odometry.at(table.t_ns).xyyaw[known], odometry.at(t_ns).xyyaw)
        xyyaw = se2.compose(xyyaw, np.where(np.isfinite(moved), moved, 0.0))
    xyyaw[latest < 0] = np.nan
    cov = planar_from_ros(table["covariance"])[known]
    cov[latest < 0] = np.nan
    return xyyaw, cov


def _pose_arrival(view: BundleView, table: Table) -> NDArray[np.int64]:
    """(K,) when each row of the localizer's poses could first be used."""
    return np.maximum(arrival_ns(view, table["t_log_ns"]), table.t_ns)


_NEVER = np.zeros(0, dtype=np.int64)
