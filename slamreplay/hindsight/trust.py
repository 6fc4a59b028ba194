"""Which keyframes have a pose that can be believed, and whether the log fits the map at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.products import LEAST_LEAD
from slamreplay.geometry import se2
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.places import WEIGHT, Places
from slamreplay.hindsight.submaps import Submap, owners

#: A log of which the typical submap fits worse than this, and no place stands out by more than
#: that, is not in this map. Logs laid onto foreign maps reached 0.55 and 0.075, logs in their own
#: maps 0.67 and 0.12 or more, changed ones included.
FITS_SCORE, FITS_MARGIN = 0.6, 0.1
#: A stretch of solid motion is placed if its scans fit the map this well on average.
STRETCH_SCORE = 0.4
#: Beyond this standard deviation a pose is no pose.
SIGMA_MAX_M = 0.5


def fits_map(places: Places) -> bool:
    """Whether this map holds the log: the places fit well, or stand out from all others."""
    stands_out = places.margin is None or places.margin >= FITS_MARGIN
    score = float(np.median(places.score))
    return score >= FITS_SCORE or (stands_out and score >= 0.5 * FITS_SCORE)


def trusted_keyframes(
    places: Places,
    chain: Chain,
    is_open: NDArray[np.bool_],
    cov: se2.Array,
    score: se2.Array,
    lead: se2.Array,
) -> NDArray[np.bool_]:
    """(K,) keyframes whose pose can be believed.

    Args:
        places: where the submaps were put.
        chain: solid motion carries trust from one keyframe to the next.
        is_open: (K - 1,) links over which the motion is not known.
        cov: (K, 3, 3) of the poses, m^2 and rad^2.
        score: (K,) of each keyframe's scan in the map at its pose.
        lead: (K,) of each keyframe's place over the best different one, see `keyframe_leads`.
    """
    if not fits_map(places):
        return np.zeros(len(score), dtype=bool)
    starts = np.append(True, is_open | ~chain.is_solid[1:])
    stretch = np.cumsum(starts) - 1
    scored = np.where(np.isfinite(score), score, 0.0)
    mean = np.bincount(stretch, weights=scored) / np.bincount(stretch)
    sigma = np.sqrt(np.linalg.eigvalsh(cov[:, :2, :2])[:, -1])
    placed = (mean[stretch] >= STRETCH_SCORE) & (sigma <= SIGMA_MAX_M)
    leads = lead >= LEAST_LEAD
    # Where most of the log has no lead it is the log that is ambiguous, and its margin says so.
    return np.asarray(placed & leads if 2 * np.count_nonzero(leads) > len(leads) else placed)


def keyframe_leads(places: Places, found: Sequence[Submap], count: int) -> se2.Array:
    """(count,) how far the place of each keyframe's submap leads the best different one.

    The best sequence of places against the best one that differs at this submap, in mean score of
    this one submap (0 to 1); inf where there is no different place. 0 for keyframes of no submap.
    """
    owner = owners(found, count)
    return np.where(owner >= 0, (places.doubt / WEIGHT)[np.maximum(owner, 0)], 0.0)
