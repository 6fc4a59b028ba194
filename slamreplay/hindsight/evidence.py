"""When each cell was seen, and when it was seen through: evidence over time on a coarse lattice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, INVALID, MISS, Beams
from slamreplay.matching.field import WorkingMap
from slamreplay.matching.threads import share_out

CELL_M, BIN_S = 0.1, 0.5
#: A pass counts up to this distance before the beam's end: noise puts ends short.
SHORT_M = 0.2
#: So many bins are worth a thread of their own.
_WORTH_A_THREAD = 50


@dataclass(frozen=True, eq=False)
class Lattice:
    """Evidence cells, `step` x `step` cells of the working map each, and bins of time.

    Attributes:
        shape: rows and columns.
        step: working map cells along an edge.
        width: columns of the working map.
        cell_m: edge of an evidence cell.
        corner_xy: (2,) corner of cell (0, 0) in the grid's frame, m.
        bins: (N,) int32 bin of each scan.
    """

    shape: tuple[int, int]
    step: int
    width: int
    cell_m: float
    corner_xy: se2.Array
    bins: NDArray[np.int32]

    @property
    def bin_count(self) -> int:
        """T, the number of bins."""
        return int(self.bins[-1]) + 1 if len(self.bins) else 0

    def cells_of(self, where: NDArray[np.int32]) -> NDArray[np.int64]:
        """Flat evidence cells of flat working map cells."""
        row, col = np.divmod(where.astype(np.int64), self.width)
        return np.asarray(row // self.step * self.shape[1] + col // self.step)

    def fine(self, mask: NDArray, shape: tuple[int, ...]) -> NDArray:
        """Values of the lattice on the working map of that shape."""
        whole = np.repeat(np.repeat(mask, self.step, axis=0), self.step, axis=1)
        return whole[: shape[0], : shape[1]]

    def coarse(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(H, W) evidence cells that hold at least one such cell of the working map."""
        step, (rows, cols) = self.step, self.shape
        whole = np.zeros((rows * step, cols * step), dtype=bool)
        whole[: mask.shape[0], : mask.shape[1]] = mask
        return np.asarray(whole.reshape(rows, step, cols, step).any(axis=(1, 3)))


def lattice(working: WorkingMap, t_ns: NDArray[np.int64]) -> Lattice:
    """The lattice over a map, and over the times (N,) of its scans, ascending."""
    step = max(1, round(CELL_M / working.resolution_m))
    rows, cols = (-(-n // step) for n in working.walls.shape)
    bins = ((t_ns - t_ns[0]) // round(BIN_S * 1e9)).astype(np.int32)
    cell_m = step * working.resolution_m
    return Lattice((rows, cols), step, working.walls.shape[1], cell_m, working.corner_xy, bins)


def end_cells(where: Lattice, beams: Beams, poses: se2.Array) -> NDArray[np.int64]:
    """(K,) flat evidence cell of the end of each hit, -1 outside the map or without a pose."""
    cells = np.empty(np.count_nonzero(beams.kind == HIT), dtype=np.int64)
    _end_cells(beams.ends, beams.kind, poses, where.corner_xy, where.cell_m, where.shape, cells)
    return cells


@njit(cache=True)
def _end_cells(ends, kind, poses, corner, cell_m, shape, out):  # type: ignore[no-untyped-def]
    k = 0
    for s in range(kind.shape[0]):
        cos, sin = np.cos(poses[s, 2]), np.sin(poses[s, 2])
        for b in range(kind.shape[1]):
            if kind[s, b] != HIT:
                continue
            x = poses[s, 0] + cos * ends[s, b, 0] - sin * ends[s, b, 1]
            y = poses[s, 1] + sin * ends[s, b, 0] + cos * ends[s, b, 1]
            col, row = np.floor((x - corner[0]) / cell_m), np.floor((y - corner[1]) / cell_m)
            inside = 0 <= row < shape[0] and 0 <= col < shape[1]  # not of a pose that is NaN
            out[k] = int(row) * shape[1] + int(col) if inside else -1
            k += 1


def marks(
    where: Lattice,
    cells: NDArray[np.int64],
    bins: NDArray[np.int32],
    slots: NDArray[np.int32],
    radius: int,
    count: int,
) -> NDArray[np.bool_]:
    """(count, T) whether something was seen within `radius` cells of each slot in each bin.

    Args:
        where: the lattice.
        cells: (K,) flat cells where beams ended.
        bins: (K,) when.
        slots: (H, W) number of each cell that is asked for, -1 of the others.
        radius: in cells, 0 for the cell alone.
        count: how many are asked for.
    """
    out = np.zeros((count, where.bin_count), dtype=bool)
    _spread(out, cells, bins, slots, radius, np.full(slots.shape, -1, dtype=np.int32))
    return out


@njit(cache=True)
def _spread(out, cells, bins, slots, radius, done):  # type: ignore[no-untyped-def]
    height, width = slots.shape
    for k in range(cells.shape[0]):
        row, col = cells[k] // width, cells[k] % width
        # Many beams of one bin end in one cell.
        if done[row, col] == bins[k]:
            continue
        done[row, col] = bins[k]
        for r in range(max(0, row - radius), min(height, row + radius + 1)):
            for c in range(max(0, col - radius), min(width, col + radius + 1)):
                far = (r - row) * (r - row) + (c - col) * (c - col)
                if slots[r, c] >= 0 and far <= radius * radius + radius:
                    out[slots[r, c], bins[k]] = True


def bins_of_each(
    where: Lattice, cells: NDArray[np.int64], bins: NDArray[np.int32]
) -> NDArray[np.int64]:
    """(H, W) in how many different bins each cell was named.

    Args:
        where: the lattice.
        cells: (K,) flat cells.
        bins: (K,) when each was, ascending.
    """
    count = np.zeros(where.shape, dtype=np.int64)
    _count_bins(cells, bins, count.ravel(), np.full(count.size, -1, dtype=np.int32))
    return count


@njit(cache=True)
def _count_bins(cells, bins, count, last):  # type: ignore[no-untyped-def]
    for k in range(cells.shape[0]):
        if last[cells[k]] != bins[k]:
            last[cells[k]] = bins[k]
            count[cells[k]] += 1


@dataclass(frozen=True, eq=False)
class Passes:
    """Beams that went through.

    Attributes:
        through: (C, T) of the cells asked for, in which bins.
        last: (H, W) int32 index of the last scan that went through each cell, -1 for none.
        bin_count: (H, W) uint16 in how many bins.
    """

    through: NDArray[np.bool_]
    last: NDArray[np.int32]
    bin_count: NDArray[np.uint16]


def passes(
    where: Lattice,
    beams: Beams,
    poses: se2.Array,
    reach_m: float,
    slots: NDArray[np.int32],
    count: int,
) -> Passes:
    """All cells that beams went through, from poses (N, 3) in the grid's frame.

    Args:
        where: the lattice.
        beams: the scans.
        poses: NaN rows are skipped.
        reach_m: a beam without a return proves nothing beyond this.
        slots: (H, W) number of each cell that is asked for, -1 of the others.
        count: how many are asked for.
    """
    through = np.zeros((count, where.bin_count), dtype=bool)
    poses = np.ascontiguousarray(poses)
    parts: dict[int, tuple[NDArray[np.int32], NDArray[np.uint16]]] = {}

    def work(first: int, stop: int) -> None:
        """The bins from `first` to before `stop`: no bin is anybody else's."""
        last = np.full(where.shape, -1, dtype=np.int32)
        last_bin = np.full(where.shape, -1, dtype=np.int32)
        bin_count = np.zeros(where.shape, dtype=np.uint16)
        low, high = np.searchsorted(where.bins, [first, stop]).tolist()
        _passes(
            where.cell_m,
            where.corner_xy,
            where.bins,
            beams.ends,
            beams.kind,
            beams.laser_xy,
            poses,
            reach_m / where.cell_m,
            slots,
            (low, high),
            (through, last, last_bin, bin_count),
        )
        parts[first] = last, bin_count

    share_out(where.bin_count, work, _WORTH_A_THREAD)
    last, bin_count = parts.pop(0)
    for later, more in parts.values():
        np.maximum(last, later, out=last)
        bin_count += more
    return Passes(through, last, bin_count)


@njit(cache=True, nogil=True)
def _passes(  # type: ignore[no-untyped-def]  # noqa: C901
    cell, corner, bins, ends, kind, laser, poses, reach, slots, scans, out
):
    through, last, last_bin, bin_count = out
    height, width = last.shape
    for s in range(scans[0], scans[1]):
        if not np.isfinite(poses[s, 0]):
            continue
        cos, sin, now = np.cos(poses[s, 2]), np.sin(poses[s, 2]), bins[s]
        px, py = (poses[s, 0] - corner[0]) / cell, (poses[s, 1] - corner[1]) / cell
        ox = px + (cos * laser[0] - sin * laser[1]) / cell
        oy = py + (sin * laser[0] + cos * laser[1]) / cell
        for b in range(ends.shape[1]):
            if kind[s, b] == INVALID:
                continue
            dx = px + (cos * ends[s, b, 0] - sin * ends[s, b, 1]) / cell - ox
            dy = py + (sin * ends[s, b, 0] + cos * ends[s, b, 1]) / cell - oy
            length = np.sqrt(dx * dx + dy * dy)
            if length <= 0.0:
                continue
            dx, dy = 0.5 * dx / length, 0.5 * dy / length
            free = length - SHORT_M / cell
            if kind[s, b] == MISS:
                free = min(free, reach)
            x, y = ox, oy
            # Half a cell a step may skip a corner that the ray only grazes, and no more.
            for _ in range(int(2.0 * free)):
                col, row, behind = int(x), int(y), x < 0.0 or y < 0.0
                x += dx
                y += dy
                if behind or row >= height or col >= width or last[row, col] == s:
                    continue
                last[row, col] = s
                if last_bin[row, col] != now:
                    last_bin[row, col] = now
                    bin_count[row, col] += 1
                    if slots[row, col] >= 0:
                        through[slots[row, col], now] = True
