"""The map as a picture of few colours: what was mapped, and what of it is not true."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.products import Changes
from slamreplay.maps.blocks import highest_in_blocks
from slamreplay.maps.grid import OccupancyGrid

#: What a cell was mapped as: the lowest two bits of its code. In a block of cells the highest
#: wins, so that a thin wall survives.
UNKNOWN, FREE, OCCUPIED = 0, 1, 2
#: What became of it: the two bits above.
REMOVED, APPEARED = 4, 8
#: More cells than this are drawn in blocks: a browser holds four bytes for each.
_MOST_CELLS = 2_000_000


@dataclass(frozen=True, eq=False)
class Ground:
    """The map's part that says anything.

    Attributes:
        codes: (H, W) uint8, row 0 at the bottom: mapped as, plus what became of it.
        cell_m: edge of a pixel, m.
        block: so many cells of the map, squared, make one of it.
        corner: (2,) of the picture's lower left, m along the grid's own axes from its origin.
        origin_xyyaw: of the grid in the map frame.
    """

    codes: NDArray[np.uint8]
    cell_m: float
    block: int
    corner: tuple[float, float]
    origin_xyyaw: tuple[float, float, float]


def ground_of(grid: OccupancyGrid, changes: Changes | None) -> Ground | None:
    """The picture of a map; None of one in which nothing is known."""
    codes = np.zeros(grid.cells.shape, dtype=np.uint8)
    codes[grid.free] = FREE
    codes[grid.occupied] = OCCUPIED
    became = np.zeros_like(codes)
    if changes is not None:
        became[changes.removed] = REMOVED
        became[changes.appeared] = APPEARED
    told = (codes != UNKNOWN) | (became != 0)
    if not told.any():
        return None
    rows, columns = np.flatnonzero(told.any(axis=1)), np.flatnonzero(told.any(axis=0))
    first = int(rows[0]), int(columns[0])
    part = (slice(first[0], int(rows[-1]) + 1), slice(first[1], int(columns[-1]) + 1))
    codes, became = codes[part], became[part]
    block = max(1, int(np.ceil(np.sqrt(codes.size / _MOST_CELLS))))
    x, y, yaw = (float(v) for v in grid.origin_xyyaw)
    return Ground(
        highest_in_blocks(codes, block) | highest_in_blocks(became, block),
        grid.resolution_m * block,
        block,
        (first[1] * grid.resolution_m, first[0] * grid.resolution_m),
        (x, y, yaw),
    )
