"""Is the map drawn to scale? A hall drawn a tenth too large still holds most scans, badly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.geometry import se2
from slamreplay.hindsight.places import Places
from slamreplay.hindsight.submaps import Submap
from slamreplay.matching.whole_map import SearchSpace, search_map

#: Only logs whose typical submap fits worse than this are asked: it takes seconds. Right maps score
#: more but for those of which half is changed, and no other scale makes these fit.
ASK_BELOW = 0.75
#: Scales that are tried, 3 % apart; nearer to 1 than the first one a map is to scale.
SCALES = tuple(float(s) for s in np.exp(np.arange(0.05, 0.36, 0.03)))
#: So many submaps are asked, of points up to this far; another scale must fit better by this. With
#: four submaps, of 7 maps out of scale by 8 to 26 % the right one fitted better by 0.28 to 0.49,
#: and no other scale fitted any of 9 logs in right maps better, 6 of them with half of the
#: structure changed.
ASKED, RADIUS_M, GAIN = 3, 8.0, 0.15


def map_scale(space: SearchSpace, found: Sequence[Submap], places: Places) -> float | None:
    """How many times larger than the room the map is drawn; None where it is to scale.

    Args:
        space: the map to search.
        found: the submaps.
        places: where they were put.
    """
    if float(np.median(places.score)) >= ASK_BELOW:
        return None
    rows = np.unique(np.linspace(0, len(found) - 1, ASKED).round().astype(int)).tolist()
    clouds = [found[k].points[np.hypot(*found[k].points.T) < RADIUS_M] for k in rows]
    scales = [1.0, *SCALES, *(1.0 / s for s in SCALES)]
    fits = [float(np.mean([_best(space, scale * cloud) for cloud in clouds])) for scale in scales]
    best = int(np.argmax(fits))
    return scales[best] if fits[best] >= fits[0] + GAIN else None


def _best(space: SearchSpace, points: se2.Array) -> float:
    _, scores = search_map(space, points, count=1)
    return float(scores[0]) if len(scores) else 0.0
