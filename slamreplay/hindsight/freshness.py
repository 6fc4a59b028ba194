"""The freshness layer of a map, from the beams and from what was found changed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.freshness import NEVER, Freshness
from slamreplay.geometry import se2
from slamreplay.hindsight.changed_beams import MET, BeamsOnMap
from slamreplay.hindsight.evidence import Lattice, Passes
from slamreplay.hindsight.gone import Gone
from slamreplay.hindsight.standing import Standing
from slamreplay.matching.field import WorkingMap


def freshness_of(
    working: WorkingMap,
    where: Lattice,
    laid: BeamsOnMap,
    t_ns: NDArray[np.int64],
    passed: Passes,
    new: Standing,
    away: Gone,
    removed: NDArray[np.bool_],
) -> Freshness:
    """When each evidence cell was last confirmed and last contradicted.

    Args:
        working: the map.
        where: the lattice.
        laid: the beams against the map.
        t_ns: (N,) times of the scans.
        passed: what beams went through.
        new: what stands on free ground, and when.
        away: which walls are gone, and when.
        removed: (H, W) of the working map, all walls that are gone.
    """
    wall = where.coarse(working.walls)
    free = ~wall & where.coarse(~working.unknown)
    went = np.where(passed.last >= 0, t_ns[np.maximum(passed.last, 0)], NEVER)
    confirmed = np.where(free, went, NEVER)
    met, beam = np.nonzero(laid.says == MET)
    cells = where.cells_of(laid.where[met, beam])
    np.maximum.at(confirmed.ravel(), cells, t_ns[met])
    contradicted = np.where(wall & where.coarse(removed), went, NEVER)
    end_of_bin = t_ns[np.searchsorted(where.bins, np.arange(where.bin_count), side="right") - 1]
    for slots, holds, says in (
        (new.slots, new.holds & new.seen, new.empty & ~new.holds),
        (away.slots, away.holds & away.through, away.seen & ~away.holds),
    ):
        changed = np.flatnonzero(slots >= 0)
        row = slots.ravel()[changed]
        ever = np.asarray(holds.any(axis=1))[row]
        changed, row = changed[ever], row[ever]
        contradicted.ravel()[changed] = _last(holds[row], end_of_bin)
        confirmed.ravel()[changed] = _last(says[row], end_of_bin)
    corner = np.append(where.corner_xy, 0.0)
    return Freshness(
        confirmed,
        contradicted,
        where.cell_m,
        se2.compose(working.origin_xyyaw, corner),
        int(t_ns[-1]),
    )


def _last(when: NDArray[np.bool_], end_of_bin: NDArray[np.int64]) -> NDArray[np.int64]:
    last = when.shape[1] - 1 - np.argmax(when[:, ::-1], axis=1)
    return np.where(when.any(axis=1), end_of_bin[last], NEVER)
