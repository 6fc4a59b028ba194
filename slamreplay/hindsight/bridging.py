"""Stretches whose scans do not tell their place, brought back by odometry from both their ends.

Scans between bare walls, in a crowd or in a changed part of the map fit one place as well as the
next, and laid to each other they may lead astray; where odometry from the place before arrives at
the place after, it was sound all the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.graph.planar import smooth_chain
from slamreplay.hindsight.places import APART_M
from slamreplay.hindsight.weighing import FLOOR_M, FLOOR_RAD, LEVER_M, PART

#: Odometry closes a stretch if it arrives within this Mahalanobis distance, squared, that 99.9 %
#: of right ones keep (chi-square, three degrees of freedom), and not at a different place.
CLOSES = 16.27
#: What odometry misses is as independent from one such stretch of the way to the next as from one
#: keyframe to the next; keyframes that lie closer share it.
SPAN_M, SPAN_RAD = 0.5, 0.3
#: Of a standing robot it misses this: metres, metres, radians.
_LEAST = np.array([1e-3, 1e-3, 1e-3])
#: Three standard deviations of a brought back pose may be this long: beyond, it is of no use.
REACH_M = 0.5


@dataclass(frozen=True, eq=False)
class Bridged:
    """Keyframes after the bridging.

    Attributes:
        xyyaw: (K, 3) poses.
        cov: (K, 3, 3) about the map's axes, m^2 and rad^2.
        is_open: (K - 1,) links over which the motion is not known; bridged ones are.
        has_place: (K,) placed before, or brought back.
    """

    xyyaw: se2.Array
    cov: se2.Array
    is_open: NDArray[np.bool_]
    has_place: NDArray[np.bool_]


def bridged(
    poses: se2.Array,
    cov: se2.Array,
    is_open: NDArray[np.bool_],
    has_place: NDArray[np.bool_],
    odometry: se2.Array,
    is_torn: NDArray[np.bool_],
) -> Bridged:
    """Stretches without a place, put where odometry brings them from those that have one.

    A stretch between two placed keyframes is brought back if odometry leads from one to the other.
    What it misses in all widens the covariances where it is more than its noise. At an end of the
    log nothing closes: there each link's scans must agree with odometry as well, up to the first
    that does not.

    Args:
        poses: (K, 3) of the keyframes, as the map's walls have them.
        cov: (K, 3, 3) about the map's axes.
        is_open: (K - 1,) links over which the motion is not known.
        has_place: (K,) keyframes whose pose can be believed.
        odometry: (K, 3) poses as odometry tells them; not scans that stand in for it.
        is_torn: (K - 1,) links of which odometry and scans tell different motions.
    """
    out = Bridged(poses.copy(), cov.copy(), is_open.copy(), has_place.copy())
    motions = se2.between(odometry[:-1], odometry[1:])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~has_place, [False]]).astype(np.int8)))
    for first, stop in edges.reshape(-1, 2).tolist():
        if first > 0 and stop < len(poses):
            # Placed or not, what hangs by a torn link is not where odometry set out from.
            begin, end = first - 1, stop
            while begin > 0 and is_torn[begin - 1]:
                begin -= 1
            while end < len(poses) - 1 and is_torn[end]:
                end += 1
            _between_places(out, motions, begin, end)
        elif first > 0:
            _from_one(out, motions, is_torn | is_open, np.arange(first - 1, stop))
        elif stop < len(poses):
            _from_one(out, motions, is_torn | is_open, np.arange(stop, -1, -1))
    return out


def _between_places(out: Bridged, motions: se2.Array, first: int, last: int) -> None:
    """Bridge the keyframes between two placed ones, if odometry closes."""
    carried, spread = out.xyyaw[first], out.cov[first]
    for motion in motions[first:last]:
        carried, spread = _moved(carried, spread, motion)
    miss = np.append(
        out.xyyaw[last, :2] - carried[:2], se2.wrap_angle(out.xyyaw[last, 2] - carried[2])
    )
    squared = float(miss @ np.linalg.solve(spread + out.cov[last], miss))
    if np.hypot(miss[0], miss[1]) > APART_M or squared > CLOSES:
        return
    rows = np.arange(first, last + 1)
    way = motions[first:last]
    start = np.empty((len(rows), 3))
    start[0] = out.xyyaw[first]
    for k, motion in enumerate(way):
        start[k + 1] = se2.compose(start[k], motion)
    poses, cov = smooth_chain(
        start,
        way,
        _noise(way),
        np.zeros(len(way), dtype=bool),
        np.ones(len(way), dtype=bool),
        np.array([0, len(rows) - 1]),
        out.xyyaw[[first, last]],
        out.cov[[first, last]],
    )
    cov = cov * max(1.0, squared / 3.0)
    inner = rows[1:-1]
    out.xyyaw[inner], out.cov[inner] = poses[1:-1], cov[1:-1]
    out.has_place[inner] = _of_use(cov[1:-1])
    out.is_open[first:last] = False


def _from_one(
    out: Bridged, motions: se2.Array, is_doubtful: NDArray[np.bool_], rows: NDArray[np.int64]
) -> None:
    """Bring keyframes back from a placed one, the first of `rows`, to an end of the log."""
    pose, cov = out.xyyaw[rows[0]], out.cov[rows[0]]
    for a, b in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
        link = min(a, b)
        motion = motions[link] if b > a else se2.inverse(motions[link])
        pose, cov = _moved(pose, cov, motion)
        if is_doubtful[link] or not _of_use(cov[None])[0]:
            return
        out.xyyaw[b], out.cov[b], out.has_place[b] = pose, cov, True


def _moved(pose: se2.Array, cov: se2.Array, motion: se2.Array) -> tuple[se2.Array, se2.Array]:
    """Pose (3,) and covariance (3, 3) about the map's axes after a motion (3,) by odometry."""
    after = se2.compose(pose, motion)
    step = after[:2] - pose[:2]
    lever = np.array([[1.0, 0.0, -step[1]], [0.0, 1.0, step[0]], [0.0, 0.0, 1.0]])
    # The noise of x and y is the same in all axes: it needs no turning.
    return after, lever @ cov @ lever.T + _noise(motion[None])[0]


def _noise(motions: se2.Array) -> se2.Array:
    """(N, 3, 3) of what odometry misses over motions (N, 3)."""
    turn = np.abs(motions[:, 2])
    way = np.hypot(motions[:, 0], motions[:, 1]) + LEVER_M * turn
    spans = way / SPAN_M
    var_m = spans * (FLOOR_M**2 + (PART * SPAN_M) ** 2)
    var_rad = spans * FLOOR_RAD**2 + turn / SPAN_RAD * (PART * SPAN_RAD) ** 2
    variance = np.stack([var_m, var_m, var_rad], axis=1) + _LEAST**2
    return np.asarray(variance[:, :, None] * np.eye(3))


def _of_use(cov: se2.Array) -> NDArray[np.bool_]:
    """Which of covariances (N, 3, 3) pin the position."""
    longest = np.linalg.eigvalsh(cov[:, :2, :2])[:, -1]
    return np.asarray(3.0 * np.sqrt(longest) <= REACH_M)
