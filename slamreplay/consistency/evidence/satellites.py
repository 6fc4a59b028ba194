"""A belief against satellite fixes whose frame is tied to the map."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.fixes import fixes_in_map
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.carried import carried
from slamreplay.consistency.evidence.source import MAP_AXES, Evidence
from slamreplay.consistency.evidence.standing_still import against_the_past
from slamreplay.geometry.transforms import clean_frame

#: An update is held against a fix no farther from it in time than this.
_WITHIN_S = 0.5
_SKY = "what a receiver has wrong all the time was counted beside its noise"


def satellites(updates: PoseTrack, view: BundleView, motion: PoseTrack | None) -> Evidence | None:
    """Errors of a belief's updates (N rows): where they put the antenna, minus where it was fixed.

    None without fixes, or where no static transform ties them to the map. Fixes of one log share
    the sky: each may be off by what the receiver tells, and all of them together by as much again.
    """
    if clean_frame(updates.frame_id) != (view.manifest.frames.map or "map"):
        return None
    fixes = fixes_in_map(view)
    if fixes is None:
        return None
    n = len(fixes)
    antenna = np.tile([*fixes.antenna_xy, 0.0], (n, 1))
    one, exact = np.full(n, "antenna", dtype=object), np.zeros((n, 3, 3))
    at = carried(updates, motion, fixes.t_ns, one, antenna, exact, _WITHIN_S)
    if not len(at.update):
        return None
    noise = fixes.cov[at.sensed]
    apart = at.places[:, :2] - fixes.xy[at.sensed]
    error, cov = against_the_past(apart, at.cov[:, :2, :2] + noise, noise.mean(axis=0))
    t_ns = updates.t_ns[at.update]
    return Evidence(f"gnss {fixes.topic}", "gnss", t_ns, error, cov, MAP_AXES[:2], _SKY)
