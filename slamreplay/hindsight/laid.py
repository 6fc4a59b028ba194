"""Scans laid to each other, before any map: beams, keyframes and the chain between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.hindsight.beams import Beams, beams_of, side_by_side
from slamreplay.hindsight.chain import Chain, Known, scan_matched, torn_links
from slamreplay.hindsight.deskew import longest_sweep_s, motion_as_matched
from slamreplay.hindsight.held import is_held
from slamreplay.hindsight.keyframes import keyframes, with_more

#: Without odometry nothing tells how a robot moved while it saw nothing for longer than this.
UNSEEN_NS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class Laid:
    """The scans of a log in a frame that drifts.

    Attributes:
        motion: odometry, or what stands in for it; within sweeps as the scans moved.
        each: the beams of each laser.
        beams: those of all lasers side by side, N scans.
        odometry: (N, 3) pose at each scan as odometry tells it.
        keys: (K,) indices of the keyframes among the scans; none where no scan says anything.
        points: of each keyframe (M, 2) ends of its beams in the base frame.
        chain: how the keyframes lie to each other.
        is_told: the log has odometry; nothing stands in for it.
        is_held: (N,) scans whose motion is known in all directions: by odometry, or by the scans.
    """

    motion: PoseTrack
    each: list[Beams]
    beams: Beams
    odometry: se2.Array
    keys: NDArray[np.int64]
    points: list[se2.Array]
    chain: Chain
    is_told: bool
    is_held: NDArray[np.bool_]


def laid_out(base: str, lasers: Sequence[ScanSet], matching: Callable[[], None]) -> Laid:
    """Beams, keyframes and chain of one log.

    Args:
        base: name of the base frame.
        lasers: one or two.
        matching: called before the scans are matched.
    """
    motion, is_unknown = lasers[0].odometry, np.zeros(len(lasers[0].t_ns), dtype=bool)
    held = ~is_unknown
    is_told = motion is not None and bool(motion.has_pose.any())
    if motion is None or not is_told:
        still = _beside([beams_of(laser, None) for laser in lasers], None)
        motion, is_unknown, held = motion_by_scans(base, still)
    each = [beams_of(laser, motion) for laser in lasers]
    beams = _beside(each, motion)
    odometry = odometry_at(motion, beams.t_ns)
    keys = keyframes(beams, odometry, is_unknown, held)
    matching()
    points, chain = _chained(beams, odometry, keys, is_unknown)
    is_torn = torn_links(chain, odometry[keys])
    more = with_more(beams, keys, is_torn)
    if (more := more[held[more]]).size > keys.size:
        keys = more
        points, chain = _chained(beams, odometry, keys, is_unknown)
    matched = motion_as_matched(base, beams.t_ns, odometry, keys, chain, longest_sweep_s(lasers))
    if matched is not None:
        motion, told = matched.motion, each
        again = [beams_of(laser, motion) for laser in lasers]
        beams = matched.mended(beams, _beside(again, motion))
        each = [matched.mended(old, new) for old, new in zip(told, again, strict=True)]
        points, chain = _chained(beams, odometry, keys, is_unknown, (points, chain))
    return Laid(motion, each, beams, odometry, keys, points, chain, is_told, held)


def odometry_at(motion: PoseTrack, t_ns: NDArray[np.int64]) -> se2.Array:
    """(N, 3) odometry at times (N,).

    Before the first sample, after the last and in gaps the robot is taken to stand; the keyframes'
    own scan matching finds out where it did not.
    """
    poses = motion.at(t_ns, max_gap_ns=10_000_000_000).xyyaw.copy()
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    if not len(known):
        return np.zeros((len(t_ns), 3))
    before = np.searchsorted(known, np.arange(len(poses)), side="right") - 1
    return np.asarray(poses[known[np.maximum(before, 0)]])


def motion_by_scans(
    base: str, beams: Beams
) -> tuple[PoseTrack, NDArray[np.bool_], NDArray[np.bool_]]:
    """What stands in for odometry where a log has none: each scan matched to those before it.

    Returns:
        The track; for each scan (N,) whether the motion to it is not known: too long after the
        one before, like nothing before it, or the first one after scans that nothing holds; and
        whether it is held: along bare walls nothing in a scan tells how far the robot went.
    """
    late = np.append(False, np.diff(beams.t_ns) > UNSEEN_NS)
    points = [beams.points(k) for k in range(len(beams))]
    chain = scan_matched(points, None, beams.t_ns, late)
    held = is_held(beams, chain)
    track = PoseTrack.without_covariance("odom", base, beams.t_ns, chain.xyyaw)
    again = np.append(False, held[1:] & ~held[:-1])
    return track, chain.is_break | again, held


def _chained(
    beams: Beams,
    odometry: se2.Array,
    keys: NDArray[np.int64],
    is_unknown: NDArray[np.bool_],
    before: tuple[list[se2.Array], Chain] | None = None,
) -> tuple[list[se2.Array], Chain]:
    """Points of the keyframes, and how their scans lie to each other.

    What is known of the same keyframes from `before` still holds where their points are the same.
    """
    points = [beams.points(k) for k in keys]
    parts = np.cumsum(is_unknown)[keys]
    over_unknown = np.append(False, parts[1:] > parts[:-1])
    known = None
    if before is not None:
        same = [np.array_equal(a, b) for a, b in zip(points, before[0], strict=True)]
        known = Known(before[1], np.array(same))
    return points, scan_matched(points, odometry[keys], beams.t_ns[keys], over_unknown, known)


def _beside(each: list[Beams], motion: PoseTrack | None) -> Beams:
    return each[0] if len(each) == 1 else side_by_side(each[0], each[1], motion)
