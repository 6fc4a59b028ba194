"""Scan-matched odometry: each keyframe laid onto the last ones, odometry as the first guess."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.hindsight.weighing import weighed
from slamreplay.matching.correlative import Match, Window, match, search_window
from slamreplay.matching.field import WORKING_RESOLUTION_M, ScoreField, points_field
from slamreplay.matching.thinning import thin

#: Width of the score around points, and how far apart those of a scan are kept.
SIGMA_M, SPACING_M = 0.08, 0.1
#: How many keyframes back the local map reaches, and how far around the robot.
MEMORY, RADIUS_M = 12, 15.0
#: Cells of a local map at the most.
_ROOM = int(2.0 * (RADIUS_M + 1.0) / WORKING_RESOLUTION_M) ** 2
#: Below this mean score (or at the window's edge) the odometry's word is doubted.
GOOD, POOR = 0.6, 0.35
#: A wider search must beat the narrow one by this much: the odometry is a witness as well.
GAIN = 0.08
#: Within this scan and odometry agree on the motion between two keyframes.
AGREE_M, AGREE_RAD = 0.15, 0.2
#: A speed is carried on over at most this many times the time it was seen in.
MOST_LONGER = 10.0
NARROW = Window(0.3, 0.1, np.radians(12.0), np.radians(2.0), pull=0.03)
CLOSE = Window(0.05, 0.05, np.radians(1.0), np.radians(1.0), pull=0.0)
WIDE = Window(1.2, 0.1, np.radians(20.0), np.radians(2.0), pull=0.03)
AROUND = Window(0.6, 0.1, np.pi, np.radians(3.0), pull=0.03)


@dataclass(frozen=True, eq=False)
class Chain:
    """Keyframes in a drifting frame.

    Attributes:
        xyyaw: (K, 3) poses.
        score: (K,) how well each fits the ones before it; 1 for the first.
        is_break: (K,) nothing before it was found in its scan: the motion to it is not known.
        is_solid: (K,) scan and odometry agree well on the motion to it.
        information: (K, 3, 3) of each pose against the local map, chain axes.
    """

    xyyaw: se2.Array
    score: se2.Array
    is_break: NDArray[np.bool_]
    is_solid: NDArray[np.bool_]
    information: se2.Array


@dataclass(frozen=True, eq=False)
class Known:
    """A chain of the same keyframes, and (K,) whether each one's points are still the same."""

    chain: Chain
    is_same: NDArray[np.bool_]

    def still_holds(self) -> NDArray[np.bool_]:
        """(K,) keyframes whose points and local map are those that they were matched with."""
        changed = np.flatnonzero(~self.is_same)
        out = np.ones(len(self.is_same), dtype=bool)
        for k in changed.tolist():
            out[k : k + MEMORY + 1] = False
        return out


def scan_matched(
    points: Sequence[se2.Array],
    odometry: se2.Array | None,
    t_ns: NDArray[np.int64],
    is_unknown: NDArray[np.bool_],
    known: Known | None = None,
) -> Chain:
    """Match each scan against a local map of the scans before it.

    Args:
        points: K arrays (M, 2), ends of the beams in the base frame.
        odometry: (K, 3) poses in the odom frame, or None: then the speed is expected to be the one
            before, and scans that hardly moved do not enter the local map.
        t_ns: (K,) their times, ascending.
        is_unknown: (K,) nothing tells the motion from the scan before: a break, not to be matched
            over, for where walls look alike a match would be found in the wrong one.
        known: from the same odometry; matches that still hold are taken from it.
    """
    n = len(points)
    xyyaw, score = np.zeros((n, 3)), np.ones(n)
    is_break, information = np.zeros(n, dtype=bool), np.zeros((n, 3, 3))
    holds = np.zeros(n, dtype=bool) if known is None else known.still_holds()
    memory: list[tuple[int, se2.Array]] = []  # keyframes and their points where they were laid
    room = np.empty(_ROOM, dtype=np.float32)
    for k in range(n):
        scan = thin(points[k], SPACING_M)
        if k and is_unknown[k]:
            xyyaw[k], score[k], is_break[k] = xyyaw[k - 1], 0.0, True
        elif k and known is not None and holds[k]:
            old = known.chain
            xyyaw[k] = se2.compose(xyyaw[k - 1], se2.between(old.xyyaw[k - 1], old.xyyaw[k]))
            score[k], is_break[k] = old.score[k], old.is_break[k]
            information[k] = turned(old.information[k], xyyaw[k, 2] - old.xyyaw[k, 2])
        elif k and memory:
            last = xyyaw[k - 1]
            if odometry is not None:
                guess = se2.compose(last, se2.between(odometry[k - 1], odometry[k]))
            else:
                guess = se2.compose(last, _expected(xyyaw, t_ns, is_break, k))
            laid = _lay(memory, scan, guess, last, room)
            score[k], information[k] = laid.score, laid.information
            # A poor match that contradicts odometry as well has no witness at all.
            poor = laid.score < POOR
            poor |= odometry is not None and laid.score < GOOD and not _agree(guess, laid.xyyaw)
            is_break[k] = poor
            xyyaw[k] = guess if is_break[k] else laid.xyyaw
            if odometry is not None and not is_break[k]:
                xyyaw[k] = weighed(guess, laid, se2.between(last, guess), len(scan), SIGMA_M)
        if is_break[k]:
            memory = []
        # Without odometry the scans come at sensor rate: what hardly moved adds nothing.
        step = se2.between(xyyaw[memory[-1][0]], xyyaw[k]) if memory else np.ones(3)
        if odometry is not None or np.hypot(step[0], step[1]) > 0.1 or abs(step[2]) > 0.1:
            memory = [*memory[1 - MEMORY :], (k, se2.transform_points(xyyaw[k], scan))]
    is_solid = (score >= GOOD) & ~is_break
    if odometry is not None:
        is_solid[1:] &= ~_torn(xyyaw, odometry)
    return Chain(xyyaw, score, is_break, is_solid, information)


def torn_links(chain: Chain, odometry: se2.Array) -> NDArray[np.bool_]:
    """(K - 1,) links that are broken, or of which odometry (K, 3) tells another motion."""
    return chain.is_break[1:] | _torn(chain.xyyaw, odometry)


def _torn(xyyaw: se2.Array, odometry: se2.Array) -> NDArray[np.bool_]:
    told = se2.between(odometry[:-1], odometry[1:])
    return ~_agree(told, se2.between(xyyaw[:-1], xyyaw[1:]))


def _expected(
    xyyaw: se2.Array, t_ns: NDArray[np.int64], is_break: NDArray[np.bool_], k: int
) -> se2.Array:
    """(3,) motion to scan k at the speed of the motion before; none where that is not known."""
    if k < 2 or is_break[k - 1]:
        return np.zeros(3)
    longer = (t_ns[k] - t_ns[k - 1]) / max(t_ns[k - 1] - t_ns[k - 2], 1)
    return np.asarray(min(longer, MOST_LONGER) * se2.between(xyyaw[k - 2], xyyaw[k - 1]))


def _agree(a: se2.Array, b: se2.Array) -> NDArray[np.bool_]:
    """Which poses (..., 3) of two sets are about the same."""
    off = se2.between(a, b)
    near = np.hypot(off[..., 0], off[..., 1]) < AGREE_M
    return np.asarray(near & (np.abs(off[..., 2]) < AGREE_RAD))


def _lay(
    memory: list[tuple[int, se2.Array]],
    scan: se2.Array,
    guess: se2.Array,
    last: se2.Array,
    room: NDArray[np.float32],
) -> Match:
    field = _local_map(memory, last, room)
    if field is None or not len(scan):
        return Match(guess, 0.0, np.zeros((3, 3)))
    start, _ = search_window(field, scan[::2], guess, NARROW)
    best = match(field, scan, start, CLOSE)
    at_edge = np.abs(start - guess)[:2].max() > NARROW.reach_m - 1e-6
    if best.score < GOOD or at_edge:
        for centre, window in ((guess, WIDE), (last, AROUND)):
            wide = match(field, scan[::2], centre, window)
            wide = match(field, scan, wide.xyyaw, Window(0.1, 0.05, 0.04, 0.02))
            best = wide if wide.score > best.score + GAIN else best
    return best


def _local_map(
    memory: list[tuple[int, se2.Array]], centre: se2.Array, room: NDArray[np.float32]
) -> ScoreField | None:
    cloud = np.concatenate([points for _, points in memory])
    off = np.abs(cloud - centre[:2]) < RADIUS_M
    near = off[:, 0] & off[:, 1]
    return points_field(cloud[near], SIGMA_M, room=room) if near.any() else None
