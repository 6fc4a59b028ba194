"""A table of what a beam scores by the cell it ends in, and its sums over whole scans.

Scores are whole numbers of 16 bits: half the memory of float32, and their sums do not depend on
the order in which they are added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.estimators.amcl.noise import cos_sin
from slamreplay.estimators.amcl.vectors import LANES, cells_of_beams
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid

_TOP = 65535
#: Beams are summed so many at a time; what is missing to a multiple of it ends here, off any map.
_NOWHERE = 1e9


@dataclass(frozen=True, eq=False)
class ScoreTable:
    """Scores of cells, with a border of what is off the map.

    Attributes:
        cells: flat uint16, rows of 2^shift: the border is row 0 and `height - 1`, column 0 and
            `width - 1`.
        shift: of a row.
        height: rows.
        width: columns that are used.
        low: score of 0.
        step: what 1 more in a cell adds to a score.
        origin_xyyaw: (3,) of the grid's cell (0, 0) in the map.
        resolution_m: of a cell.
    """

    cells: NDArray[np.uint16]
    shift: int
    height: int
    width: int
    low: float
    step: float
    origin_xyyaw: se2.Array
    resolution_m: float

    @classmethod
    def of(cls, scores: se2.Array, grid: OccupancyGrid) -> ScoreTable:
        """From scores (H + 2, W + 2) that have the border already."""
        low, high = float(scores.min()), float(scores.max())
        step = (high - low) / _TOP
        height, width = scores.shape
        shift = int(width - 1).bit_length()
        cells = np.zeros((height, 1 << shift), dtype=np.uint16)
        if step > 0.0:
            cells[:, :width] = np.rint((scores - low) / step)
        origin = np.asarray(grid.origin_xyyaw, dtype=np.float64)
        return cls(cells.ravel(), shift, height, width, low, step, origin, grid.resolution_m)

    def sums(self, local: NDArray[np.float32], ends: se2.Array) -> se2.Array:
        """(N,) sums of scores.

        Args:
            local: (4, N) of `local_poses`.
            ends: (2, M) ends of the beams in the base frame, m.
        """
        m = ends.shape[1]
        missing = -m % LANES
        padded = np.full((2, m + missing), _NOWHERE, dtype=np.float32)
        padded[:, :m] = ends
        padded[1, m:] = 0.0
        whole = np.empty(local.shape[1], dtype=np.int64)
        score_sums(local, padded, self.cells, self.shift, self.height, self.width, whole)
        whole -= missing * int(self.cells[0])
        return self.step * whole + self.low * m

    def log_means(self, local: NDArray[np.float32], ends: se2.Array) -> se2.Array:
        """(S,) logs of the mean over poses (4, N) of exp(sum of scores), of scans (S, 2, M)."""
        out = np.empty(len(ends))
        log_means(
            local,
            ends.astype(np.float32),
            self.cells,
            self.shift,
            self.height,
            self.width,
            self.step,
            out,
        )
        return out + self.low * ends.shape[2]

    def local(self, particles: se2.Array) -> NDArray[np.float32]:
        """(4, N) of particles (3, N): column and row in the table, cosine and sine by cell."""
        out = np.empty((4, particles.shape[1]), dtype=np.float32)
        local_poses(particles, self.origin_xyyaw, 1.0 / self.resolution_m, out)
        return out


@njit(cache=True, fastmath={"contract", "nsz", "nnan"}, error_model="numpy")
def local_poses(particles, origin, per_m, out):  # type: ignore[no-untyped-def]
    """Fill (4, N): columns, rows (with the border), cosines and sines of headings, in cells per m.

    Of particles (3, N) in the map; `origin` (3,) is the grid's.
    """
    cos_o, sin_o = np.cos(origin[2]) * per_m, np.sin(origin[2]) * per_m
    x_o, y_o, yaw_o = origin[0], origin[1], origin[2]
    for i in range(particles.shape[1]):
        dx, dy = particles[0, i] - x_o, particles[1, i] - y_o
        cos, sin = cos_sin(particles[2, i] - yaw_o)
        out[0, i] = np.float32(cos_o * dx + sin_o * dy + 1.0)
        out[1, i] = np.float32(cos_o * dy - sin_o * dx + 1.0)
        out[2, i] = np.float32(per_m * cos)
        out[3, i] = np.float32(per_m * sin)


@njit(cache=True, error_model="numpy")
def score_sums(local, ends, cells, shift, height, width, out):  # type: ignore[no-untyped-def]
    """Fill (N,) with sums over M beams, a multiple of 16, of the cells they end in.

    Args: local (4, N) of `local_poses`, ends (2, M) float32, cells flat uint16. Cells are found 16
    at a time: in whole numbers of 2^-shift rows, whose fraction is then masked off, so that a row
    times its length costs no multiplication, and as unsigned numbers, of which negative ones are
    large and so meet the border, too. Those of the particle before are looked up meanwhile, two to
    a word: one keeps the arithmetic units busy and the other the loads.
    """
    n, beams = local.shape[1], ends.shape[1]
    found = np.zeros((2, beams // 2), dtype=np.uint64)
    index = found.view(np.uint32)
    us, vs = ends[0], ends[1]
    fraction = np.uint32((1 << shift) - 1)
    last_row = np.uint32(((height - 1) << shift) | fraction)
    border = (np.uint32(width - 1), last_row, np.uint32(~fraction))
    half, low = np.uint64(32), np.uint64(0xFFFFFFFF)
    one, two, three, four = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
    five, six, seven, eight = np.uint64(5), np.uint64(6), np.uint64(7), np.uint64(8)
    scale = np.float32(1 << shift)
    words = np.uint64(beams // 2)  # unsigned indices: none is counted from the end
    for i in range(n + 1):
        k = min(i, n - 1)
        x, y, cos, sin = local[0, k], local[1, k], local[2, k], local[3, k]
        pose = (x, cos, sin, y * scale, cos * scale, sin * scale)
        coming, here = index[i & 1], found[1 - (i & 1)]
        a, b, c, d = np.uint32(0), np.uint32(0), np.uint32(0), np.uint32(0)
        for w in range(np.uint64(0), words, eight):
            cells_of_beams(coming, w + w, us, vs, pose, border)
            p, q, r, s = here[w], here[w + one], here[w + two], here[w + three]
            a = np.uint32(a + cells[p & low])
            b = np.uint32(b + cells[p >> half])
            c = np.uint32(c + cells[q & low])
            d = np.uint32(d + cells[q >> half])
            a = np.uint32(a + cells[r & low])
            b = np.uint32(b + cells[r >> half])
            c = np.uint32(c + cells[s & low])
            d = np.uint32(d + cells[s >> half])
            p, q, r, s = here[w + four], here[w + five], here[w + six], here[w + seven]
            a = np.uint32(a + cells[p & low])
            b = np.uint32(b + cells[p >> half])
            c = np.uint32(c + cells[q & low])
            d = np.uint32(d + cells[q >> half])
            a = np.uint32(a + cells[r & low])
            b = np.uint32(b + cells[r >> half])
            c = np.uint32(c + cells[s & low])
            d = np.uint32(d + cells[s >> half])
        if i > 0:
            out[i - 1] = np.int64(a) + np.int64(b) + np.int64(c) + np.int64(d)


@njit(cache=True, fastmath={"contract", "nsz"}, error_model="numpy")
def fits(local, ends, cells, shift, height, width, count):  # type: ignore[no-untyped-def]
    """Fill (M,) with how many of N poses a beam ends on a cell that is not 0 at.

    Args: as of `score_sums`, but any number of beams.
    """
    for j in range(ends.shape[1]):
        u, v = ends[0, j], ends[1, j]
        found = 0
        for i in range(local.shape[1]):
            col = int(local[0, i] + local[2, i] * u - local[3, i] * v)
            row = int(local[1, i] + local[3, i] * u + local[2, i] * v)
            if 0 < col < width - 1 and 0 < row < height - 1:
                found += cells[(row << shift) | col] > 0
        count[j] = found


@njit(cache=True, fastmath={"contract", "nsz"}, error_model="numpy")
def log_means(local, ends, cells, shift, height, width, step, out):  # type: ignore[no-untyped-def]
    """Fill (S,): log of the mean over poses (4, N) of exp(step times sum over beams (S, 2, M))."""
    sums = np.empty(local.shape[1])
    for k in range(ends.shape[0]):
        top = -np.inf
        for i in range(local.shape[1]):
            total = 0
            for j in range(ends.shape[2]):
                u, v = ends[k, 0, j], ends[k, 1, j]
                col = int(local[0, i] + local[2, i] * u - local[3, i] * v)
                row = int(local[1, i] + local[3, i] * u + local[2, i] * v)
                col, row = min(max(col, 0), width - 1), min(max(row, 0), height - 1)
                total += cells[(row << shift) | col]
            sums[i] = step * total
            top = max(top, sums[i])
        mean = 0.0
        for i in range(local.shape[1]):
            mean += np.exp(sums[i] - top)
        out[k] = top + np.log(mean / local.shape[1])
