"""Where on the whole map, at which heading, do these points fit? The best distinct places.

Every cell of a coarse lattice is scored at every heading, so that nothing is missed. The coarse
field holds the largest score within each cell and a little around it (max-pooled, as in the branch
and bound of Hess et al., ICRA 2016), hence the coarse score bounds from above what any pose in the
cell can reach, up to the heading step. Scores are bytes and the inner loop adds whole rows of
them, which a processor does 32 or more at a time: for a map of a hall this beats a tree of bounds
that prunes but cannot add rows. The best cells of each heading sector are then refined.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, maximum_filter

from slamreplay.geometry import se2
from slamreplay.matching.correlative import Window, match_each
from slamreplay.matching.field import ScoreField, WorkingMap
from slamreplay.matching.threads import share_out

#: uint16 sums of bytes up to 250 hold 262 points.
MAX_POINTS = 260
_BYTE = 250
_SECTORS = 8


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """A map made ready to be searched.

    Attributes:
        coarse: (H, W) uint8 max-pooled scores, without padding.
        allowed: (H, W) cells the robot may stand in.
        cell_m: edge of a coarse cell.
        fine: the field that places are refined and scored in.
    """

    coarse: NDArray[np.uint8]
    allowed: NDArray[np.bool_]
    cell_m: float
    fine: ScoreField


def search_space(working: WorkingMap, fine: ScoreField, cell_m: float = 0.2) -> SearchSpace:
    """The coarse lattice over a map; a robot stands on free cells or within a metre of one."""
    step = max(1, round(cell_m / working.resolution_m))
    spread = maximum_filter(fine.values, size=2 * (step // 2) + 1)
    height, width = (-(-n // step) for n in fine.values.shape)
    whole = np.zeros((height * step, width * step), dtype=np.float32)
    whole[: spread.shape[0], : spread.shape[1]] = spread
    coarse = whole.reshape(height, step, width, step).max(axis=(1, 3))
    free = np.zeros(whole.shape, dtype=bool)
    free[: spread.shape[0], : spread.shape[1]] = ~working.unknown & ~working.walls
    free = np.asarray(free.reshape(height, step, width, step).any(axis=(1, 3)))
    cell = step * working.resolution_m
    allowed = distance_transform_edt(~free) * cell <= 1.0 if free.any() else ~free
    return SearchSpace(np.rint(coarse * _BYTE).astype(np.uint8), allowed, cell, fine)


def search_map(
    space: SearchSpace,
    points: se2.Array,
    *,
    count: int = 40,
    heading_step_rad: float = np.radians(2.0),
) -> tuple[se2.Array, se2.Array]:
    """The best distinct poses (K, 3) of points (N, 2) and their mean fine scores (K,), best first.

    Args:
        space: the map.
        points: about the pose that is looked for; beyond `MAX_POINTS` they are thinned evenly.
        count: how many places at most; two of them differ by 0.6 m or 20 degrees.
        heading_step_rad: lattice of headings.
    """
    if not len(points):
        return np.empty((0, 3)), np.empty(0)
    if len(points) > MAX_POINTS:
        points = points[np.linspace(0, len(points) - 1, MAX_POINTS).astype(np.int64)]
    starts = _coarse_peaks(space, points, count + count // 2, heading_step_rad)
    # The lattice leaves half a cell and half a heading step to either side.
    half = space.cell_m / 2.0
    window = Window(half, half / 2.0, heading_step_rad / 2.0, heading_step_rad / 2.0)
    tops = match_each(space.fine, [points], starts, window)
    keep = distinct(tops.xyyaw, tops.score, count)
    return tops.xyyaw[keep], tops.score[keep]


def distinct(
    poses: se2.Array, scores: se2.Array, count: int, apart_m: float = 0.3, apart_rad: float = 0.2
) -> NDArray[np.int64]:
    """Indices of the best poses, best first, of which no two are near in place and heading."""
    left = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    while len(left) and len(kept) < count:
        best = left[0]
        kept.append(int(best))
        near = np.hypot(*(poses[left, :2] - poses[best, :2]).T) < apart_m
        near &= np.abs(se2.wrap_angle(poses[left, 2] - poses[best, 2])) < apart_rad
        left = left[~near]
    return np.array(kept, dtype=np.int64)


def _coarse_peaks(
    space: SearchSpace, points: se2.Array, count: int, heading_step_rad: float
) -> se2.Array:
    per_sector = int(np.ceil(2.0 * np.pi / _SECTORS / heading_step_rad))
    step = 2.0 * np.pi / (_SECTORS * per_sector)
    headings = step * np.arange(_SECTORS * per_sector, dtype=np.float64)
    reach = int(np.ceil(np.hypot(*points.T).max() / space.cell_m)) + 2
    padded = np.pad(space.coarse, reach)
    best, which = _score_lattice(padded, reach, points / space.cell_m, headings, per_sector)
    best[:, ~space.allowed] = 0
    # One candidate per block of 3 x 3 cells and sector keeps a broad peak from filling the list.
    shape = best.shape
    rows, cols = -(-shape[1] // 3), -(-shape[2] // 3)
    blocks = np.zeros((_SECTORS, rows * 3, cols * 3), dtype=np.uint16)
    blocks[:, : shape[1], : shape[2]] = best
    blocks = blocks.reshape(_SECTORS, rows, 3, cols, 3).transpose(0, 1, 3, 2, 4)
    blocks = blocks.reshape(_SECTORS, rows, cols, 9)
    inner = blocks.argmax(axis=-1)
    top = np.take_along_axis(blocks, inner[..., None], axis=-1)[..., 0]
    order = np.argsort(-top.ravel().astype(np.int64), kind="stable")[: 12 * count]
    order = order[top.ravel()[order] > 0]
    sector, block_row, block_col = np.unravel_index(order, top.shape)
    offset = inner[sector, block_row, block_col]
    row, col = block_row * 3 + offset // 3, block_col * 3 + offset % 3
    heading = headings[sector * per_sector + which[sector, row, col]]
    xy = space.fine.corner_xy + (np.stack([col, row], axis=1) + 0.5) * space.cell_m
    poses = np.column_stack([xy, heading])
    return poses[distinct(poses, top[sector, block_row, block_col].astype(float), count, 0.5, 0.3)]


def _score_lattice(
    padded: NDArray[np.uint8], reach: int, cells: se2.Array, headings: se2.Array, per_sector: int
) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:
    height, width = padded.shape[0] - 2 * reach, padded.shape[1] - 2 * reach
    best = np.zeros((len(headings) // per_sector, height, width), dtype=np.uint16)
    which = np.zeros(best.shape, dtype=np.uint8)
    flat, padded_width = padded.ravel(), padded.shape[1]

    def work(first: int, stop: int) -> None:
        """The sectors from `first` to before `stop`."""
        some = headings[first * per_sector : stop * per_sector]
        total = np.zeros(width, dtype=np.uint16)
        offset = np.zeros(len(cells), dtype=np.int64)
        out = best[first:stop], which[first:stop]
        _add_rows(flat, padded_width, reach, cells, some, per_sector, *out, total, offset)

    share_out(len(best), work)
    return best, which


@njit(cache=True, nogil=True)
def _add_rows(  # type: ignore[no-untyped-def]  # noqa: C901
    flat, padded_width, reach, cells, headings, per_sector, best, which, total, offset
):
    height, width = best.shape[1], best.shape[2]
    count = cells.shape[0]
    full = count - count % 4
    for h in range(headings.shape[0]):
        cos, sin = np.cos(headings[h]), np.sin(headings[h])
        for p in range(count):
            # The robot stands in the middle of a cell: half a cell more, then down.
            x = cos * cells[p, 0] - sin * cells[p, 1] + 0.5
            y = sin * cells[p, 0] + cos * cells[p, 1] + 0.5
            offset[p] = (reach + int(np.floor(y))) * padded_width + reach + int(np.floor(x))
        sector, part = h // per_sector, np.uint8(h % per_sector)
        for row in range(height):
            start = row * padded_width
            for i in range(width):
                total[i] = 0
            for p in range(0, full, 4):
                a = flat[start + offset[p] : start + offset[p] + width]
                b = flat[start + offset[p + 1] : start + offset[p + 1] + width]
                c = flat[start + offset[p + 2] : start + offset[p + 2] + width]
                d = flat[start + offset[p + 3] : start + offset[p + 3] + width]
                for i in range(width):
                    pair = np.uint16(a[i]) + np.uint16(b[i])
                    total[i] += pair + np.uint16(c[i]) + np.uint16(d[i])
            for p in range(full, count):
                a = flat[start + offset[p] : start + offset[p] + width]
                for i in range(width):
                    total[i] += np.uint16(a[i])
            top, at = best[sector, row], which[sector, row]
            for i in range(width):
                if total[i] > top[i]:
                    top[i] = total[i]
                    at[i] = part
