"""A belief's motion against an odometry that it was not carried by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import topic_track
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.carried import SLIP, driven
from slamreplay.consistency.evidence.source import Evidence
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import between, is_positive_definite
from slamreplay.geometry.times import ns

#: A window begins at an update and ends at the first one after so long; not later than the second.
_WINDOW_S, _LONGEST_S = 5.0, 10.0
#: What an odometry that tells no growing covariance is taken to miss beside `SLIP`, one sigma.
_ANY_M, _ANY_RAD = 0.02, 0.02
#: An odometry whose motion over a window differs by less, in most windows, is the same one again.
_SAME_M, _SAME_RAD = 2e-3, 2e-3
#: Vertical motion above this part of the whole is no base's: the axes are a camera's.
_VERTICAL = 0.3
#: Fewer windows tell nothing.
_LEAST = 3

_AXES = ("forward m", "left m", "yaw rad")
_BOTH_ENDS = "the covariances of both ends of a window were added, though their errors are alike"


def second_odometry(
    updates: PoseTrack, view: BundleView, motion: PoseTrack | None
) -> tuple[Evidence, ...]:
    """Errors of a belief's motion over windows, one piece of evidence for each further odometry.

    From one update to another some seconds later, in axes of the robot at the first: the belief's
    motion minus the odometry's. No update is in two windows. Topics that only repeat the odometry
    the belief is carried by are left out.
    """
    table = view.table("odometry")
    start, end = _windows(updates)
    found = []
    for topic in sorted(set(table["topic"].astype(str))):
        rows = table.take(table["topic"] == topic)
        if len(start) < _LEAST or not _is_of_base(view, rows):
            continue
        track = topic_track(view, rows)
        if not len(track):
            continue
        step, way = driven(track, updates.t_ns[start], updates.t_ns[end])
        known = np.isfinite(step).all(axis=1)
        other, _ = driven(motion, updates.t_ns[start], updates.t_ns[end])
        if known.sum() < _LEAST or _repeats(step, other):
            continue
        b, e, step, way = start[known], end[known], step[known], way[known]
        error = se2.between(updates.xyyaw[b], updates.xyyaw[e]) - step
        error[:, 2] = se2.wrap_angle(error[:, 2])
        cov = between(updates.xyyaw[b], updates.cov[b], updates.xyyaw[e], updates.cov[e])
        cov += _growth(track, updates.t_ns[b], updates.t_ns[e], way)
        found.append(Evidence(f"second odometry {topic}", "second_odometry", updates.t_ns[e],
                              error, cov, _AXES, _BOTH_ENDS))  # fmt: skip
    return tuple(found)


def _is_of_base(view: BundleView, rows: Table) -> bool:
    """Whether it is told where on the robot what it moves sits, and it moves in the plane."""
    base, child = view.manifest.frames.base, str(rows["child_frame_id"][0])
    if base and child not in ("", base) and not view.transforms.has_path(child, base):
        return False
    spread = np.ptp(rows["position_xyz"], axis=0)
    return bool(spread[2] <= _VERTICAL * np.linalg.norm(spread))


def _windows(updates: PoseTrack) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of the first and the last update of each window."""
    t_ns, start, end, at = updates.t_ns, [], [], 0
    while at < len(t_ns):
        last = int(np.searchsorted(t_ns, t_ns[at] + ns(_WINDOW_S)))
        if last < len(t_ns) and t_ns[last] - t_ns[at] <= ns(_LONGEST_S):
            start.append(at)
            end.append(last)
            at = last
        at += 1
    return np.array(start, dtype=np.int64), np.array(end, dtype=np.int64)


def _repeats(step: se2.Array, other: se2.Array) -> bool:
    """Whether steps (M, 3) are those of the belief's own odometry, or those are unknown."""
    apart = step - other
    apart = apart[np.isfinite(apart).all(axis=1)]
    if not len(apart):
        return True
    turned = float(np.median(np.abs(se2.wrap_angle(apart[:, 2]))))
    return float(np.median(np.hypot(apart[:, 0], apart[:, 1]))) < _SAME_M and turned < _SAME_RAD


def _growth(
    track: PoseTrack, from_ns: NDArray[np.int64], to_ns: NDArray[np.int64], way: se2.Array
) -> se2.Array:
    """(M, 3, 3) what the odometry adds over a window, in axes of its start.

    By its own covariance where that grows: the end's is the start's, swung, plus the growth. Else
    `SLIP` of the way and of the turn, and a little.
    """
    sigma = SLIP * way + np.array([_ANY_M, _ANY_M, _ANY_RAD])
    out = sigma[:, :, None] ** 2 * np.eye(3)
    # A covariance belongs to the pose of its own sample: swung about any other it fits no more.
    start, end = (np.searchsorted(track.t_ns, t, side="right") - 1 for t in (from_ns, to_ns))
    pose, cov = track.xyyaw, track.cov
    own = between(pose[start], -cov[start], pose[end], cov[end])
    own = 0.5 * (own + np.swapaxes(own, 1, 2))
    grows = is_positive_definite(own)
    out[grows] = own[grows]
    return out
