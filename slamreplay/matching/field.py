"""Score fields: what a point that lies at a place is worth, 1 on a wall, 0 away from all of them.

The score of a point is exp(-d^2 / (2 sigma^2)) with d its distance to the nearest wall. It
saturates: a point that fits nothing counts nothing, so a missing rack cannot outvote the walls that
are still there. This is Welsch's robust loss, and minus the second derivative of its sum is the
information of the match where errors have the standard deviation sigma.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.likelihood_field import gaussian_field

#: Finer maps are searched at this resolution: their extra cells cost memory and add no accuracy
#: beyond the scanner's own noise.
WORKING_RESOLUTION_M = 0.05
#: Wall cells nearer than this to a face that is seen from free space are inside that wall.
_FACE_CELLS = 3


@dataclass(frozen=True, eq=False)
class ScoreField:
    """Scores on a lattice.

    Attributes:
        values: (H, W) float32 in [0, 1].
        resolution_m: edge of a cell.
        corner_xy: (2,) lower left corner of cell (0, 0) in the field's frame, m.
    """

    values: NDArray[np.float32]
    resolution_m: float
    corner_xy: se2.Array


@dataclass(frozen=True, eq=False)
class WorkingMap:
    """A map cropped to what is known of it, at the resolution it is searched at.

    Its frame is the grid's own: metres along rows and columns from the corner of cell (0, 0), so
    that a turned origin costs nothing here; `to_map` leads out.

    Attributes:
        walls: (H, W) occupied cells.
        unknown: (H, W) cells nobody has seen.
        resolution_m: edge of a cell.
        corner_xy: (2,) lower left corner of cell (0, 0) in the grid's frame, m.
        origin_xyyaw: (3,) the grid's frame in the map frame.
    """

    walls: NDArray[np.bool_]
    unknown: NDArray[np.bool_]
    resolution_m: float
    corner_xy: se2.Array
    origin_xyyaw: se2.Array

    def to_map(self, xyyaw: se2.Array) -> se2.Array:
        """Poses (..., 3) from the grid's frame into the map frame."""
        return se2.compose(self.origin_xyyaw, xyyaw)

    def field(self, sigma_m: float) -> ScoreField:
        """The score field around the faces of its walls.

        Beams end on faces. Inside a thick wall every pose would score alike, and the match would
        float by the thickness.
        """
        beside_free = binary_dilation(~self.walls & ~self.unknown) & self.walls
        hidden = self.walls & ~binary_dilation(
            beside_free, np.ones((3, 3), dtype=bool), iterations=_FACE_CELLS
        )
        cells = np.where(beside_free | hidden, np.int8(100), np.int8(0))
        grid = OccupancyGrid(cells, self.resolution_m, np.zeros(3))
        values = gaussian_field(grid, sigma_m, 6.0 * sigma_m)
        values[values < 1e-4] = 0.0
        return ScoreField(values, self.resolution_m, self.corner_xy)


def working_map(grid: OccupancyGrid, margin_m: float = 1.0) -> WorkingMap | None:
    """The part of a map that is known, no finer than needed, or None where nothing is."""
    known = grid.cells >= 0
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows) or not grid.occupied.any():
        return None
    step = max(1, round(WORKING_RESOLUTION_M / grid.resolution_m))
    pad = int(np.ceil(margin_m / grid.resolution_m))
    low = np.array([rows[0] - pad, cols[0] - pad])
    size = np.array([rows[-1] + pad + 1, cols[-1] + pad + 1]) - low
    size = -(-size // step) * step
    walls, unknown = np.zeros(size, dtype=bool), np.ones(size, dtype=bool)
    into = np.s_[rows[0] - low[0] : rows[-1] + 1 - low[0], cols[0] - low[1] : cols[-1] + 1 - low[1]]
    source = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    walls[into] = grid.occupied[source]
    unknown[into] = ~known[source]
    blocks = (size[0] // step, step, size[1] // step, step)
    return WorkingMap(
        np.asarray(walls.reshape(blocks).any(axis=(1, 3))),
        np.asarray(unknown.reshape(blocks).all(axis=(1, 3))),
        grid.resolution_m * step,
        low[::-1] * grid.resolution_m,
        grid.origin_xyyaw,
    )


def points_field(
    points: se2.Array,
    sigma_m: float,
    resolution_m: float = WORKING_RESOLUTION_M,
    room: NDArray[np.float32] | None = None,
) -> ScoreField:
    """The score field around points, in their frame.

    Args:
        points: (N, 2), N >= 1.
        sigma_m: of the bell.
        resolution_m: edge of a cell.
        room: memory (M,) for the cells, which last until it is used again: one field after another
            costs less in it than in fresh memory. Not used where it is too small.
    """
    margin = 3.0 * sigma_m + resolution_m
    corner = np.floor((points.min(axis=0) - margin) / resolution_m) * resolution_m
    extent = np.ceil((points.max(axis=0) + margin - corner) / resolution_m).astype(np.int64) + 1
    size = int(extent[0] * extent[1])
    if room is None or len(room) < size:
        room = np.empty(size, dtype=np.float32)
    values = room[:size].reshape(int(extent[1]), int(extent[0]))
    values[:] = 0.0
    sigma = sigma_m / resolution_m
    reach = int(np.ceil(3.0 * sigma))
    whole = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    _splat(values, (points - corner) / resolution_m, sigma, whole, np.empty(len(whole), np.float32))
    return ScoreField(values, resolution_m, corner)


@njit(cache=True, nogil=True)
def _splat(values, cells, sigma, whole, fall_x):  # type: ignore[no-untyped-def]
    """Write the largest exp(-d^2 / 2 sigma^2) over all points into each cell; all in cells.

    With d = a + j, j whole, the bell is that of a times that of j (`whole`) times a power of one
    ratio: two exponentials per point and axis. Points lie a bell's reach from the edges.
    """
    reach, scale = whole.shape[0] // 2, -0.5 / (sigma * sigma)
    for k in range(cells.shape[0]):
        col, row = int(cells[k, 0]), int(cells[k, 1])
        off = col + 0.5 - cells[k, 0]
        ratio = np.exp(2.0 * scale * off)
        power = np.exp(scale * off * off) * ratio**-reach
        for j in range(2 * reach + 1):
            fall_x[j] = power * whole[j]
            power *= ratio
        off = row + 0.5 - cells[k, 1]
        ratio = np.exp(2.0 * scale * off)
        power = np.exp(scale * off * off) * ratio**-reach
        for i in range(2 * reach + 1):
            fall_y = np.float32(power * whole[i])
            power *= ratio
            line = values[row - reach + i, col - reach : col + reach + 1]
            for j in range(2 * reach + 1):
                value = fall_y * fall_x[j]
                if value > line[j]:
                    line[j] = value
