"""Where the best sequence of places jumps: both sides are asked where the motion puts the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.geometry import se2
from slamreplay.hindsight.places import Hypotheses, best_places
from slamreplay.hindsight.search import joined
from slamreplay.hindsight.submaps import Submap
from slamreplay.matching.field import WorkingMap
from slamreplay.matching.whole_map import SearchSpace

#: So many submaps to either side of a jump are asked.
REACH = 4


def with_heirs(
    space: SearchSpace,
    working: WorkingMap,
    found: Sequence[Submap],
    hypotheses: Sequence[Hypotheses],
    motions: se2.Array,
    jump_cost: se2.Array,
) -> list[Hypotheses]:
    """The hypotheses, with the place that the measured motion leads to over each jump added.

    Where a submap sees people, or what the map does not have, its own place is one of the worst on
    its list; handed on from list to list by score it was lost, and a jump had to be believed.

    Args:
        space: the map.
        working: the same map's walls.
        found: the S submaps.
        hypotheses: of each.
        motions: (S - 1, 3) measured motion from each reference to the next.
        jump_cost: (S - 1,) what it costs to believe that it moved otherwise.
    """
    lists = list(hypotheses)
    places = best_places(lists, motions, jump_cost)
    for s in np.flatnonzero(places.jumps).tolist():
        onward, back = places.xyyaw[s], places.xyyaw[s + 1]
        for t in range(s + 1, min(s + 1 + REACH, len(found))):
            onward = se2.compose(onward, motions[t - 1])
            lists[t] = joined(space, working, found[t], lists[t], onward[None], is_sure=False)
        for t in range(s, max(s - REACH, -1), -1):
            back = se2.compose(back, se2.inverse(motions[t]))
            lists[t] = joined(space, working, found[t], lists[t], back[None], is_sure=False)
    return lists
