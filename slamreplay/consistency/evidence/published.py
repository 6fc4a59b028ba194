"""The belief where it was really published: NEES must not count a held covariance again."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import planar_from_ros
from slamreplay.geometry.transforms import clean_frame


def published_belief(view: BundleView) -> PoseTrack | None:
    """Poses with a covariance as the localizer published them, base in map, sorted by stamp.

    AMCL publishes on updates only, stamped with the scan it used, so these rows are the updates.
    None where no pose topic plays the role or no row has a covariance.
    """
    table = update_rows(view)
    if table is None or not len(table):
        return None
    yaw = se3.yaw_from_quaternion(table["orientation_xyzw"])
    xyyaw = np.column_stack([table["position_xyz"][:, :2], yaw])
    frames = view.manifest.frames
    child = clean_frame(str(table["child_frame_id"][0]))
    base = frames.base or child or "base_link"
    if child and child != base and view.transforms.has_path(child, base):
        T, known = view.transforms.lookup(child, base, table.t_ns)
        xyyaw = np.where(known[:, None], se2.compose(xyyaw, se3.planar(T)), np.nan)
    frame = clean_frame(str(table["frame_id"][0])) or frames.map or "map"
    return PoseTrack(frame, base, table.t_ns, xyyaw, planar_from_ros(table["covariance"]))


def update_rows(view: BundleView) -> Table | None:
    """The rows of the belief's topic with a covariance, in time order; None without such a topic.

    Of equal stamps the last message holds.
    """
    table = view.role("covariance") or view.role("pose")
    if table is None:
        return None
    order = np.argsort(table.t_ns, kind="stable")
    cov = planar_from_ros(table["covariance"])
    order = order[~np.isnan(cov[order]).all(axis=(1, 2))]
    t = table.t_ns[order]
    return table.take(order[np.append(t[1:] != t[:-1], True)] if len(order) else order)


def fresh_rows(track: PoseTrack) -> PoseTrack:
    """The rows of a track whose covariance is not bit by bit that of the row before."""
    if not len(track):
        return track
    given = np.isfinite(track.cov).all(axis=(1, 2))
    same = (track.cov[1:] == track.cov[:-1]).all(axis=(1, 2))
    return track.take(given & np.append(True, ~same))
