"""What went with a wall that is gone: the inside and the back of a rack, once seen empty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_propagation, maximum_filter

from slamreplay.hindsight.changed_beams import BEYOND_M
from slamreplay.hindsight.evidence import BIN_S, Lattice, Passes
from slamreplay.hindsight.gone import GONE_S
from slamreplay.matching.field import WorkingMap


def empty_since(
    where: Lattice, ends: tuple[NDArray[np.int64], NDArray[np.int32]], passed: Passes
) -> NDArray[np.bool_]:
    """(H, W) evidence cells that beams went through, and near which nothing was seen after that."""
    seen = np.full(where.shape, -where.bin_count, dtype=np.int32)
    np.maximum.at(seen.ravel(), *ends)
    near = maximum_filter(seen, 2 * round(BEYOND_M / where.cell_m) + 1)
    went = np.where(passed.last >= 0, where.bins[np.maximum(passed.last, 0)], -1)
    long_enough = round(GONE_S / BIN_S)
    return np.asarray((passed.bin_count >= long_enough) & (went >= near + long_enough))


def went_with_it(
    working: WorkingMap, removed: NDArray[np.bool_], empty: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(H, W) walls and unmapped cells seen empty that hang together with walls that are gone.

    Beams say of the first wall alone that it is gone. A rack has an inside that nobody mapped, and
    a back.

    Args:
        working: the map.
        removed: (H, W) the walls that beams met first.
        empty: (H, W) cells seen empty.
    """
    room = empty & (working.walls | working.unknown)
    near = maximum_filter(removed, 2 * round(BEYOND_M / working.resolution_m) + 1)
    start = removed | (near & room)
    return np.asarray(binary_propagation(start, np.ones((3, 3), dtype=bool), mask=start | room))
