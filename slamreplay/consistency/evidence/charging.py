"""A belief against docks: whenever charging begins at one, the robot stands in the same place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.batteries import charging_stretches
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.carried import carried
from slamreplay.consistency.evidence.source import MAP_AXES, Evidence
from slamreplay.consistency.evidence.standing_still import against_the_past, things
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns

#: Charging that begins within so much of where a belief put a dock begins at that dock: m, rad.
SAME_DOCK_M, SAME_DOCK_RAD = 1.5, np.radians(45.0)
#: How a robot may stand in one dock, one sigma: m and rad. Makers of wireless chargers accept 20 to
#: 50 mm aside of the middle, which is two of these; of headings they publish nothing, and a robot
#: whose contacts are half a metre apart keeps both within those 2 cm if it is turned by 2 degrees.
PLAY_M, PLAY_RAD = 0.02, np.radians(2.0)
#: A robot in its dock is not localised anew, and batteries tell seldom: an update this old will do.
_WITHIN_S = 30.0
#: A robot in its dock is charged for so long at least, and has come to rest after so long. What
#: charges while it drives is a driver that counts its current the other way round.
_LEAST_S, _SETTLED_S, _AT_REST_M = 10.0, 2.0, 0.05
#: A robot that has not gone so far, m, since charging last began is still in its dock.
_LEFT_M = 0.5

_CANCELS = "what is always wrong in a belief cancels between two dockings"


def charging(updates: PoseTrack, view: BundleView, motion: PoseTrack | None) -> Evidence | None:
    """Errors of a belief's updates (N rows) between dockings, or None where it docked once.

    Where the belief is when charging begins, minus where it was when charging began at the same
    dock before, in x, y and heading. Without odometry nothing shows that the robot stood still.
    """
    if motion is None or not len(motion):
        return None
    starts = _dockings(charging_stretches(view), motion)
    n = len(starts)
    play = np.tile(np.diag([PLAY_M, PLAY_M, PLAY_RAD]) ** 2, (n, 1, 1))
    # Two batteries, or two dockings between two updates, would count one belief twice.
    one = np.full(n, "dock", dtype=object)
    at = carried(updates, motion, starts, one, np.zeros((n, 3)), play, _WITHIN_S)
    which = things(at.places, SAME_DOCK_M, SAME_DOCK_RAD)
    parts = []
    for dock in range(int(which.max(initial=-1)) + 1):
        own = at.take(which == dock)
        if len(own.update) > 1:
            places = own.places - own.places[0]
            places[:, 2] = se2.wrap_angle(places[:, 2])
            errors = against_the_past(places, own.cov, None)
            parts.append((starts[own.sensed[1:]], *errors))
    if not parts:
        return None
    t_ns, error, cov = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.argsort(t_ns, kind="stable")
    return Evidence(
        "charging edges", "dock", t_ns[order], error[order], cov[order], MAP_AXES, _CANCELS
    )


def _dockings(stretches: NDArray[np.int64], motion: PoseTrack) -> NDArray[np.int64]:
    """Starts of those stretches (N, 2) that a robot spent in a dock it had come to."""
    found: list[int] = []
    for start, end in stretches.tolist():
        if end - start < ns(_LEAST_S):
            continue
        if not _spread(motion, start + ns(_SETTLED_S), start + ns(_LEAST_S)) <= _AT_REST_M:
            continue
        if not found or _spread(motion, found[-1], start) > _LEFT_M:
            found.append(start)
    return np.array(found, dtype=np.int64)


def _spread(motion: PoseTrack, start_ns: int, end_ns: int) -> float:
    """How far apart the base was within a time, m; NaN where odometry does not tell."""
    xy = motion.xyyaw[(motion.t_ns >= start_ns) & (motion.t_ns <= end_ns), :2]
    return float(np.ptp(xy, axis=0).max()) if len(xy) else float("nan")
