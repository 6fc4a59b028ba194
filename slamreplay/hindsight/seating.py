"""From the places of submaps to a first pose of every keyframe."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.places import Places
from slamreplay.hindsight.submaps import Submap, owners
from slamreplay.matching.correlative import match_each
from slamreplay.matching.field import ScoreField
from slamreplay.matching.thinning import thin


def seat_keyframes(
    field: ScoreField,
    points: list[se2.Array],
    chain: Chain,
    found: list[Submap],
    places: Places,
) -> tuple[se2.Array, NDArray[np.bool_]]:
    """Keyframe poses (K, 3) as the places of their submaps have them, and which links are open.

    Where the places jump, the jump goes between those two keyframes that make the scans on both
    sides fit best.
    """
    owner = owners(found, len(points))
    reference = np.array([s.reference for s in found])
    is_open = np.zeros(max(len(points) - 1, 0), dtype=bool)
    is_open[np.flatnonzero(chain.is_break[1:])] = True
    for s in np.flatnonzero(places.jumps).tolist():
        one, two = found[s], found[s + 1]
        low, high = one.reference, two.reference
        if is_open[low:high].any():
            continue
        members = np.arange(low, high + 1)
        fits = [
            _fit(field, points, members, se2.compose(places.xyyaw[i], _relative(chain, m, members)))
            for i, m in ((s, one), (s + 1, two))
        ]
        # Keyframes up to the cut go with the first place, those after it with the second.
        gain = np.cumsum(fits[0] - fits[1])[:-1]
        cut = int(np.argmax(gain))
        owner[members[: cut + 1]], owner[members[cut + 1 :]] = s, s + 1
        is_open[low + cut] = True
    safe = np.maximum(owner, 0)
    relative = se2.between(chain.xyyaw[reference[safe]], chain.xyyaw)
    return se2.compose(places.xyyaw[safe], relative), is_open


def _relative(chain: Chain, submap: Submap, members: NDArray[np.int64]) -> se2.Array:
    return se2.between(chain.xyyaw[submap.reference], chain.xyyaw[members])


def _fit(
    field: ScoreField, points: list[se2.Array], members: NDArray[np.int64], poses: se2.Array
) -> se2.Array:
    return match_each(field, [thin(points[k], 0.1) for k in members], poses, None).score
