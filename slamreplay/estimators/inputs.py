"""What estimators read, or the sentence that says what the log lacks."""

from __future__ import annotations

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.scans import ScanSet, scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.maps.grid import OccupancyGrid


def need_odometry(view: BundleView, estimator: str) -> PoseTrack:
    """The odometry.

    Raises:
        NotApplicableError: neither tf nor a topic has any.
    """
    track = odometry_track(view)
    if track is None or not track.has_pose.any():
        raise NotApplicableError("needs odometry, and the log has none", where=estimator)
    return track


def need_scans(view: BundleView, estimator: str) -> ScanSet:
    """The scans.

    Raises:
        NotApplicableError: no topic plays the scan role, or it has no rows.
    """
    scans = scan_set(view)
    if scans is None or not len(scans):
        raise NotApplicableError("needs laser scans, and the log has none", where=estimator)
    return scans


def need_grid(view: BundleView, estimator: str) -> OccupancyGrid:
    """The map.

    Raises:
        NotApplicableError: there is none.
    """
    if view.grid is None:
        hint = "give it with --map when the log is ingested"
        raise NotApplicableError("needs a map, and the log has none", where=estimator, hint=hint)
    return view.grid
