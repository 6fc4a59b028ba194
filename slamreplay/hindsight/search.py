"""Hypotheses of each submap: the best places on the whole map, and where its neighbours put it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.places import Hypotheses
from slamreplay.hindsight.submaps import Submap, blocked_share
from slamreplay.matching.correlative import Window, match_each
from slamreplay.matching.field import WorkingMap
from slamreplay.matching.whole_map import SearchSpace, distinct, search_map

COUNT, PASSED_ON = 40, 6
#: So many other places of a whole map fit as well by chance: where scans see people, or what the
#: map does not have, the best place on the map is only the luckiest.
CHANCE_RANK = 10
#: Where the motion is beyond doubt, every so manieth submap is searched for on the whole map; those
#: between take over the places of both, carried by that motion: this many.
SEARCH_STRIDE, CARRIED_ON = 4, 16
#: Each mapped wall that a ray crosses speaks against a place, but softly: it may be gone.
BLOCKED_WEIGHT, BLOCKED_FREE = 0.2, 0.05
_NEAR = Window(0.3, 0.1, np.radians(4.0), np.radians(2.0), pull=0.02)


def hypotheses_of(
    space: SearchSpace,
    working: WorkingMap,
    found: Sequence[Submap],
    motions: se2.Array,
    is_break: NDArray[np.bool_],
    is_solid: NDArray[np.bool_],
    say: Callable[[float], None],
) -> list[Hypotheses]:
    """Hypotheses of every submap, best first.

    A submap in a changed part of the map may fit many places better than its own; the measured
    motion from a neighbour that is certain puts its own place on the list.

    Args:
        space: the map to search.
        working: the same map's walls.
        found: the S submaps.
        motions: (S - 1, 3) from each reference to the next.
        is_break: (S - 1,) motions that are not known.
        is_solid: (S - 1,) motions that are beyond doubt.
        say: told the share done.
    """
    searched = _searched(is_solid)
    lists = []
    for i, submap in enumerate(found):
        poses, scores = np.empty((0, 3)), np.empty(0)
        if searched[i]:
            poses, scores = search_map(space, submap.points, count=COUNT)
        known = _scored(working, submap, poses, scores)
        if len(known.score) > CHANCE_RANK:
            known = replace(known, chance=float(known.score[CHANCE_RANK]))
        lists.append(known)
        say((i + 1) / len(found))
    for s in np.flatnonzero(~is_break).tolist():
        many = PASSED_ON if searched[s + 1] else CARRIED_ON
        onward = se2.compose(lists[s].xyyaw[:many], motions[s])
        is_sure = bool(is_solid[s] and not searched[s + 1])
        lists[s + 1] = joined(space, working, found[s + 1], lists[s + 1], onward, is_sure=is_sure)
    for s in np.flatnonzero(~is_break)[::-1].tolist():
        many = PASSED_ON if searched[s] else CARRIED_ON
        back = se2.compose(lists[s + 1].xyyaw[:many], se2.inverse(motions[s]))
        is_sure = bool(is_solid[s] and not searched[s])
        lists[s] = joined(space, working, found[s], lists[s], back, is_sure=is_sure)
    return lists


def _searched(is_solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(S,) submaps to search for: both ends of each solid stretch and some within it."""
    out = np.zeros(len(is_solid) + 1, dtype=bool)
    starts = np.append(0, np.flatnonzero(~is_solid) + 1)
    for first, last in zip(starts, np.append(starts[1:], len(out)) - 1, strict=True):
        out[first : last + 1 : SEARCH_STRIDE] = True
        out[last] = True
    return out


def _scored(working: WorkingMap, submap: Submap, poses: se2.Array, scores: se2.Array) -> Hypotheses:
    blocked = blocked_share(working, submap, poses)
    scores = scores - BLOCKED_WEIGHT * np.maximum(0.0, blocked - BLOCKED_FREE)
    order = np.argsort(-scores, kind="stable")
    return Hypotheses(poses[order], scores[order])


def joined(
    space: SearchSpace,
    working: WorkingMap,
    submap: Submap,
    known: Hypotheses,
    new: se2.Array,
    *,
    is_sure: bool,
) -> Hypotheses:
    """The known places and those (N, 3) that a neighbour's lead to; sure motion needs no window."""
    # As expected and unmoved too: where nothing of the map is left, a window leads astray.
    found = match_each(space.fine, [submap.points], new if is_sure else new[:1], None)
    poses, scores = found.xyyaw, found.score
    if not is_sure:
        near = match_each(space.fine, [submap.points], new, _NEAR)
        poses, scores = np.concatenate([near.xyyaw, poses]), np.append(near.score, scores)
    fresh = _scored(working, submap, poses, scores)
    poses = np.concatenate([known.xyyaw, fresh.xyyaw])
    scores = np.concatenate([known.score, fresh.score])
    keep = distinct(poses, scores, len(poses), apart_m=0.1, apart_rad=0.05)
    return Hypotheses(poses[keep], scores[keep], known.chance)
