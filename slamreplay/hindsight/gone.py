"""Which mapped walls are gone, and since when: beams went through and nothing is seen nearby."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.hindsight.changed_beams import BEYOND, BEYOND_M, BeamsOnMap
from slamreplay.hindsight.evidence import BIN_S, Lattice, marks
from slamreplay.hindsight.occupancy import taken

#: A mapped wall is gone when beams surely went through it for this long.
GONE_S = 1.0


@dataclass(frozen=True, eq=False)
class Gone:
    """Cells of the evidence lattice whose walls were passed.

    Attributes:
        slots: (H, W) int32 row of each cell in `holds`, -1 of walls that stopped every beam.
        holds: (C, T) the wall was gone in that bin.
        through: (C, T) beams went through, surely or not.
        seen: (C, T) something was seen there or near.
        through_s: (C,) for how long beams surely went through.
        seen_s: (C,) for how long something was seen there or near while it was gone.
    """

    slots: NDArray[np.int32]
    holds: NDArray[np.bool_]
    through: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    through_s: NDArray[np.float64]
    seen_s: NDArray[np.float64]


def gone(
    where: Lattice, on_map: BeamsOnMap, ends: tuple[NDArray[np.int64], NDArray[np.int32]]
) -> Gone:
    """The mapped walls that beams went through, and when they were gone.

    Args:
        where: the lattice.
        on_map: the beams against the map.
        ends: (K,) flat cells and bins in which beams ended.
    """
    scan, beam = np.nonzero(on_map.says == BEYOND)
    cells = where.cells_of(on_map.where[scan, beam])
    sure = on_map.is_sure[scan, beam]
    slots = np.full(where.shape, -1, dtype=np.int32)
    asked = np.unique(cells)
    slots.ravel()[asked] = np.arange(len(asked), dtype=np.int32)
    passed = marks(where, cells[sure], where.bins[scan[sure]], slots, 0, len(asked))
    radius = round(BEYOND_M / where.cell_m)
    seen = marks(where, *ends, slots, radius, len(asked))
    is_gone = ~taken(seen, passed)
    alone = passed & ~seen
    enough = np.count_nonzero(alone & is_gone, axis=1) * BIN_S >= GONE_S
    is_gone &= enough[:, None]
    # Beams along its edge are too unsure to prove a wall gone, but go where its neighbours went.
    edge = ~(passed.any(axis=1))
    holds = is_gone.copy()
    row, col = np.divmod(asked, where.shape[1])
    for k in np.flatnonzero(edge).tolist():
        around = slots[max(0, row[k] - 1) : row[k] + 2, max(0, col[k] - 1) : col[k] + 2]
        around = around[around >= 0]
        holds[k] = is_gone[around].any(axis=0) & ~seen[k]
    return Gone(
        slots,
        holds,
        marks(where, cells, where.bins[scan], slots, 0, len(asked)),
        seen,
        np.count_nonzero(alone & holds, axis=1) * BIN_S,
        np.count_nonzero(seen & holds, axis=1) * BIN_S,
    )
