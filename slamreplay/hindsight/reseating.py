"""Stretches that fit where they were put far worse than somewhere else: they are put there.

A robot that stood still before it was carried away is one keyframe among the many of its submap,
and too few to speak for a jump; asked alone, its scans know where they were taken.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.chain import Chain
from slamreplay.matching.correlative import climb
from slamreplay.matching.thinning import thin
from slamreplay.matching.whole_map import MAX_POINTS, SearchSpace, search_map

#: A keyframe that scores less than this part of the log's typical place is asked again.
POOR_PART = 0.7
#: It moves to a place that scores this much more, this part of the typical score at the least, and
#: this much more than the next best place: a change of the map makes a scan fit badly where it was
#: taken, but hardly well, and better than anywhere, somewhere else.
GAIN, LEAST_PART, AHEAD = 0.25, 0.85, 0.05
#: Longer stretches have submaps of their own, which were searched for already.
LONGEST = 30
SPACING_M = 0.2


def reseated(
    space: SearchSpace,
    points: Sequence[se2.Array],
    poses: se2.Array,
    chain: Chain,
    is_open: NDArray[np.bool_],
    score: se2.Array,
    typical: float,
) -> tuple[se2.Array, NDArray[np.bool_]] | None:
    """Poses and open links with misfitting stretches moved, or None where none is.

    Args:
        space: the map to search.
        points: K scans in the base frame.
        poses: (K, 3) of the keyframes.
        chain: the scan-matched odometry between them.
        is_open: (K - 1,) links over which the motion is not known.
        score: (K,) of each keyframe's scan at its pose.
        typical: the log's typical score of a place.
    """
    moved, opened, found = poses.copy(), is_open.copy(), False
    for first, stop in _stretches(score < POOR_PART * typical, is_open):
        if stop - first > LONGEST:
            continue
        middle = (first + stop) // 2
        relative = se2.between(chain.xyyaw[middle], chain.xyyaw[first:stop])
        cloud = np.concatenate(
            [
                se2.transform_points(pose, thin(points[k], SPACING_M))
                for k, pose in zip(range(first, stop), relative, strict=True)
            ]
        )
        cloud = thin(cloud, SPACING_M)
        if not len(cloud):
            continue
        if len(cloud) > MAX_POINTS:
            cloud = cloud[np.linspace(0, len(cloud) - 1, MAX_POINTS).astype(np.int64)]
        tops, scores = search_map(space, cloud, count=5)
        if not len(scores):
            continue
        here = climb(space.fine, cloud, poses[middle]).score
        runner_up = scores[1] if len(scores) > 1 else 0.0
        least = max(here + GAIN, LEAST_PART * typical, runner_up + AHEAD)
        if scores[0] < least:
            continue
        moved[first:stop] = se2.compose(tops[0], relative)
        opened[max(first - 1, 0) : first] = True
        opened[stop - 1 : stop] = True
        found = True
    return (moved, opened) if found else None


def _stretches(poor: NDArray[np.bool_], is_open: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and stop of runs of poor keyframes; an open link ends one."""
    starts = np.append(True, (poor[1:] != poor[:-1]) | is_open)
    firsts = np.flatnonzero(starts)
    stops = np.append(firsts[1:], len(poor))
    return [(int(a), int(b)) for a, b in zip(firsts, stops, strict=True) if poor[a]]
