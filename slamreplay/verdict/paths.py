"""Where the robot was about to go when it began to move, in its own frame."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.geometry.transforms import clean_frame
from slamreplay.verdict.clearance import HERE

#: An action is looked at over the first metre and a half of its plan, or three seconds of its way.
AHEAD_M, AHEAD_NS = 1.5, 3 * NS_PER_S
_EVERY_M = 0.1


class Paths:
    """Plans and odometry of a log, asked for the way that lay ahead.

    Args:
        view: the log.
        belief: base in map, for plans in the map frame.
    """

    def __init__(self, view: BundleView, belief: PoseTrack | None) -> None:
        self._belief, self._odometry = belief, odometry_track(view)
        plans = view.role("plan")
        self._plans = None if plans is None or not len(plans) else plans.sorted_by_time()

    def ahead(self, t_ns: int, *, planned: bool) -> se2.Array:
        """(M, 2) places in the base frame at `t_ns`: planned, else driven after it; at least one.

        Places nearer to each other than a decimetre are left out.
        """
        path = self._plan(t_ns) if planned else None
        path = self._driven(t_ns) if path is None else path
        return HERE if path is None else _thinned(path)

    def _plan(self, t_ns: int) -> se2.Array | None:
        if self._plans is None:
            return None
        row = int(np.searchsorted(self._plans.t_ns, t_ns, side="right")) - 1
        if row < 0 or len(self._plans["xyyaw"][row]) < 3:
            return None
        frame = clean_frame(str(self._plans["frame_id"][row]))
        points = self._plans["xyyaw"][row].reshape(-1, 3)[:, :2]
        for track in (self._belief, self._odometry):
            if track is not None and clean_frame(track.frame_id) == frame:
                pose = track.at(np.array([t_ns])).xyyaw[0]
                if np.isfinite(pose).all():
                    local = se2.transform_points(se2.inverse(pose), points)
                    start = int(np.argmin(np.hypot(local[:, 0], local[:, 1])))
                    way = np.hypot(*np.diff(local[start:], axis=0).T).cumsum()
                    return local[start : start + 1 + int((way <= AHEAD_M).sum())]
        return None

    def _driven(self, t_ns: int) -> se2.Array | None:
        if self._odometry is None:
            return None
        times = t_ns + np.linspace(0, AHEAD_NS, 31).astype(np.int64)
        poses = self._odometry.at(times).xyyaw
        if not np.isfinite(poses[0]).all():
            return None
        poses = poses[np.isfinite(poses).all(axis=1)]
        return np.asarray(se2.between(poses[0], poses)[:, :2])


def _thinned(path: se2.Array) -> se2.Array:
    way = np.concatenate([[0.0], np.hypot(*np.diff(path, axis=0).T).cumsum()])
    _, first = np.unique(np.floor(way / _EVERY_M), return_index=True)
    return np.asarray(path[first])
