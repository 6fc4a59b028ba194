"""How far a beam without a return proves that space is free: what this lidar, in this log, sees."""

from __future__ import annotations

import numpy as np

from slamreplay.hindsight.beams import HIT, MISS, Beams
from slamreplay.hindsight.changed_beams import MET, BeamsOnMap

BIN_M, MIN_BEAMS = 1.0, 50
#: Where more than this share of the beams that should meet a wall come back empty, a beam without
#: a return says nothing.
BLIND_SHARE = 0.5


def proven_reach_m(beams: Beams, on_map: BeamsOnMap) -> float:
    """Where the lidar becomes blind, in m; inf where it never does.

    Data sheets promise a range for white walls met head-on. Here the beams whose wall the map
    expects at some distance are counted: returns from that wall against no return at all.
    """
    empty = on_map.wall_m[beams.kind == MISS]
    empty = empty[np.isfinite(empty)]
    if not len(empty):
        return np.inf
    back = on_map.wall_m[(on_map.says == MET) & (beams.kind == HIT)]
    far = int(max(empty.max(), back.max(initial=0.0)) / BIN_M) + 1
    met, missed = (
        np.bincount((wall_m / BIN_M).astype(np.int64), minlength=far) for wall_m in (back, empty)
    )
    blind = (met + missed >= MIN_BEAMS) & (missed > BLIND_SHARE * (met + missed))
    return float(np.flatnonzero(blind)[0]) * BIN_M if blind.any() else np.inf
