"""What a robot believes between the rows of a run: the latest one, carried on by odometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2


def carried(track: PoseTrack, odometry: PoseTrack | None, t_ns: NDArray[np.int64]) -> PoseTrack:
    """A run at other times, so that one with fewer rows is not judged at fewer moments.

    Args:
        track: rows of a run; those without a pose are passed over, as a robot would.
        odometry: of the undisturbed log; None carries nothing, and only moments with a row of
            their own have a pose. Where it was perturbed every moment has such a row.
        t_ns: (M,) times.

    Returns:
        M rows without covariance, NaN before the first pose.
    """
    posed = track.take(track.has_pose)
    posed = posed.take(np.argsort(posed.t_ns, kind="stable"))
    xyyaw = np.full((len(t_ns), 3), np.nan)
    if len(posed):
        latest = np.searchsorted(posed.t_ns, t_ns, side="right") - 1
        there = latest >= 0
        own = there & (posed.t_ns[latest] == t_ns)
        if odometry is not None:
            since, now = odometry.at(posed.t_ns).xyyaw[latest], odometry.at(t_ns).xyyaw
            moved = se2.compose(posed.xyyaw[latest], se2.between(since, now))
            xyyaw[there] = moved[there]
        xyyaw[own] = posed.xyyaw[latest][own]
    return PoseTrack.without_covariance(track.frame_id, track.child_frame_id, t_ns, xyyaw)
