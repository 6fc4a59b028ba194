"""Whether a beam without a return proves that space is free: what this lidar, in this log, sees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.hindsight.beams import HIT, MISS, Beams
from slamreplay.hindsight.changed_beams import BEYOND, MET, BeamsOnMap
from slamreplay.hindsight.evidence import Lattice

BIN_M, MIN_BEAMS = 1.0, 50
#: Where more than this share of the beams that should meet a wall come back empty, a beam without
#: a return says nothing.
BLIND_SHARE = 0.5
#: A lidar that gets nothing back from walls, at the very time at which other beams meet them, this
#: often (in missed beams per met one) is lossy: glass and dark paint swallow its light.
LOSSY_SHARE = 0.02


def proven_reach_m(beams: Beams, on_map: BeamsOnMap) -> float:
    """Where the lidar becomes blind, in m; inf where it never does.

    Data sheets promise a range for white walls met head-on. Here the beams whose wall the map
    expects at some distance are counted: returns from that wall against no return at all. A lidar
    that meets walls at some distance sees all nearer ones: if those give nothing back they are
    gone.
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
    is_asked = met + missed >= MIN_BEAMS
    blind = is_asked & (missed > BLIND_SHARE * (met + missed))
    sees = np.flatnonzero(is_asked & ~blind)
    blind[: sees[-1] + 1 if len(sees) else 0] = False
    return float(np.flatnonzero(blind)[0]) * BIN_M if blind.any() else np.inf


def is_lossy(where: Lattice, beams: Beams, on_map: BeamsOnMap) -> bool:
    """Whether beams often come back empty from walls that stand.

    Counted are the beams without a return towards a cell that other beams met within the same bin
    of time: that wall cannot be gone.

    Args:
        where: the lattice.
        beams: the scans.
        on_map: the same against the map; those beyond the proven reach are silent.
    """
    met = _cells_and_bins(where, on_map, on_map.says == MET)
    empty = _cells_and_bins(where, on_map, (on_map.says == BEYOND) & (beams.kind == MISS))
    if len(empty) < MIN_BEAMS:
        return False
    return bool(np.count_nonzero(np.isin(empty, met)) > LOSSY_SHARE * len(met))


def _cells_and_bins(
    where: Lattice, on_map: BeamsOnMap, asked: NDArray[np.bool_]
) -> NDArray[np.int64]:
    scan, beam = np.nonzero(asked)
    cells = where.cells_of(on_map.where[scan, beam])
    return np.asarray(cells * where.bin_count + where.bins[scan])
