"""The best pose of a window, up to the whole map, by branch and bound.

Hess et al. (Real-time loop closure in 2D lidar SLAM, ICRA 2016) bound squares of places at one
heading. Here a node also spans up to eight headings: each point is looked up in a table widened by
what it moves over them. What is found is the optimum of the lattice, as if every pose were scored.

The coarsest nodes are bounded all together, by adding whole tables of bytes, which a processor does
32 or more at a time; only what is left after that is looked up point by point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.matching.field import ScoreField
from slamreplay.matching.pyramid import BYTE, LEVELS, LONGEST_RUN, SPREADS, Pyramid
from slamreplay.matching.threads import share_out

#: So many coarsest nodes are worth adding up together. At first there are about so many at most,
#: and if more than a share of them is left, up to so many more on a finer level.
_WORTH_ADDING, _FIRST_NODES, _FEW, _MOST_NODES = 64, 500_000, 0.02, 20_000_000
#: The least coarse of the coarsest levels: one square less costs more runs than it spares nodes.
_LEAST_LEVEL = 3
#: Coarsest nodes are shared out to threads from here on.
_WORTH_A_THREAD = 32


@dataclass(frozen=True, eq=False)
class PoseWindow:
    """Poses to search: a lattice about a centre, which is one of its poses.

    Attributes:
        centre: (3,) x, y, yaw in the field's frame.
        reach_m: to either side along the field's x and y axes.
        reach_rad: to either side in yaw; from pi on all headings.
    """

    centre: se2.Array
    reach_m: tuple[float, float]
    reach_rad: float

    @classmethod
    def whole(cls, field: ScoreField) -> PoseWindow:
        """Every cell of a field, all headings."""
        extent = np.array(field.values.shape[::-1]) * field.resolution_m
        centre = np.append(field.corner_xy + extent / 2.0, 0.0)
        return cls(centre, (float(extent[0] / 2.0), float(extent[1] / 2.0)), np.pi)


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best pose of a window.

    Attributes:
        xyyaw: (3,) in the field's frame.
        score: mean over the points of the scores of the cells they lie in, 0 to 1.
        nodes: how many were bounded one by one, a measure of the work.
    """

    xyyaw: se2.Array
    score: float
    nodes: int


def heading_step(points: se2.Array, resolution_m: float) -> float:
    """The turn that moves the farthest of points (N, 2) by one cell: Hess et al. 2016, eq. 7."""
    farthest = max(float(np.hypot(points[:, 0], points[:, 1]).max(initial=0.0)), resolution_m)
    return float(np.arccos(1.0 - resolution_m**2 / (2.0 * farthest**2)))


def best_pose(
    bounds: Pyramid,
    points: se2.Array,
    window: PoseWindow,
    *,
    step_rad: float | None = None,
    min_score: float = 0.0,
) -> Optimum | None:
    """The best pose of the window's lattice: places one cell apart, headings `step_rad` apart.

    Args:
        bounds: of the field that is searched.
        points: (N, 2) m, about the pose that is looked for.
        window: the poses.
        step_rad: lattice of headings, `heading_step` of the points unless told.
        min_score: a pose must score more than this.

    Returns:
        The optimum; one of them where poses score exactly alike. None where no pose scores more
        than `min_score`, or there are no points.
    """
    if not len(points):
        return None
    field, points = bounds.field, np.ascontiguousarray(points, dtype=np.float64)
    lattice = _lattice(field, points, window, step_rad)
    search = _search(bounds, lattice)
    best = np.array([min_score * len(points), -1.0, -1.0, -1.0, 0.0])
    level = int(search[1][6])
    while True:
        tops = _bound_tops(bounds, search, level)
        # A good pose found early prunes the rest: the best node of each run comes first.
        flat = tops.reshape(-1)
        first = tops.reshape(len(tops), -1).argmax(axis=1) + np.arange(len(tops)) * tops[0].size
        _visit(bounds, search, level, flat, first, best)
        flat[first] = 0
        left = np.flatnonzero(flat > best[0] * BYTE)
        # Where much is left, as in a cloud that half fits, adding up finer nodes costs less.
        if len(left) < _FEW * len(flat) or level == _LEAST_LEVEL or 8 * len(flat) > _MOST_NODES:
            break
        level -= 1
    _visit(bounds, search, level, flat, left, best)
    if best[3] < 0.0:
        return None
    xy = lattice.corner_xy + best[[2, 1]] * field.resolution_m
    yaw = se2.wrap_angle(lattice.headings[int(best[3])])
    return Optimum(np.append(xy, yaw), float(best[0] / len(points)), int(best[4]))


def _visit(
    bounds: Pyramid,
    search: tuple[NDArray, ...],
    level: int,
    tops: NDArray[np.int32],
    nodes: NDArray[np.int64],
    best: se2.Array,
) -> None:
    nodes = nodes[np.argsort(-tops[nodes], kind="stable")]
    _descend(bounds.field.values, bounds.bounds, search, level, nodes, tops[nodes], best)


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Poses: `shape` (rows, columns) of cells from `corner_xy`, at each of the `headings` (K,).

    `cells` (K, N, 2) int32: column and row of each point from the first place.
    """

    corner_xy: se2.Array
    shape: tuple[int, int]
    headings: se2.Array
    cells: NDArray[np.int32]
    longest_run: int


def _lattice(
    field: ScoreField, points: se2.Array, window: PoseWindow, step_rad: float | None
) -> _Lattice:
    resolution = field.resolution_m
    step = heading_step(points, resolution) if step_rad is None else step_rad
    if window.reach_rad >= np.pi:
        turns = np.arange(int(np.ceil(2.0 * np.pi / step)), dtype=np.float64)
        step = 2.0 * np.pi / len(turns)
    else:
        reach = int(np.ceil(window.reach_rad / step - 1e-9))
        turns = np.arange(-reach, reach + 1, dtype=np.float64)
    headings = window.centre[2] + turns * step
    sides = np.ceil(np.array(window.reach_m) / resolution - 1e-9).astype(np.int64)
    corner = window.centre[:2] - sides * resolution
    cells = np.empty((len(headings), len(points), 2), dtype=np.int32)
    _cells(
        points, np.cos(headings), np.sin(headings), *(corner - field.corner_xy), resolution, cells
    )
    # How far the farthest point moves in a run must not be more than the tables are widened by.
    farthest = float(np.hypot(points[:, 0], points[:, 1]).max())
    run = LONGEST_RUN
    while (
        run > 1
        and 2.0 * farthest * np.sin(min((run - 1) * step, np.pi) / 2.0)
        > (SPREADS[-1] - 1e-6) * resolution
    ):
        run //= 2
    rows, cols = 2 * int(sides[1]) + 1, 2 * int(sides[0]) + 1
    return _Lattice(corner, (rows, cols), headings, cells, run)


def _search(bounds: Pyramid, lattice: _Lattice) -> tuple[NDArray, ...]:
    """What the kernels go by: the lattice, its coarsest level, and room for the nodes' tables."""
    rows, cols = lattice.shape
    headings, points = lattice.cells.shape[:2]
    level = _LEAST_LEVEL
    while (rows >> level) * (cols >> level) * headings // lattice.longest_run > _FIRST_NODES:
        if level == LEVELS:
            break
        level += 1
    shape = np.array(
        [rows, cols, headings, bounds.margin, *bounds.padded, level, lattice.longest_run]
    )
    # Runs of a level begin at `starts`; a run's tables are filled in when it is first looked at.
    starts = np.zeros(level + 2, dtype=np.int64)
    for k in range(1, level + 1):
        run = min(1 << k, lattice.longest_run)
        starts[k + 1] = starts[k] + -(-headings // run)
    where = np.empty((int(starts[-1]), points, 3), dtype=np.int64)
    ranges = np.zeros((int(starts[-1]), 5), dtype=np.int64)
    return lattice.cells, shape, starts, where, ranges


def _bound_tops(bounds: Pyramid, search: tuple[NDArray, ...], level: int) -> NDArray[np.int32]:
    """(runs, rows, columns) bounds of all nodes of a level, in `BYTE`s of score."""
    shape, starts = search[1], search[2]
    square = 1 << level
    rows, cols = -(-int(shape[0]) // square), -(-int(shape[1]) // square)
    runs = int(starts[level + 1] - starts[level])
    tops = np.zeros((runs, rows, cols), dtype=np.int32)
    width = int(shape[5]) // square
    worth = rows * cols >= _WORTH_ADDING and cols <= width

    def work(first: int, stop: int) -> None:
        total = np.zeros(rows * width if worth else 0, dtype=np.uint16)
        _add_tables(bounds.bounds, search, level, first, stop, total, tops)

    share_out(runs, work, _WORTH_A_THREAD)
    return tops


@njit(cache=True, nogil=True)
def _cells(points, cos, sin, x, y, resolution, out):  # type: ignore[no-untyped-def]
    """Write the column and row of each point at each heading, seen from (x, y)."""
    scale = 1.0 / resolution
    for k in range(cos.shape[0]):
        c, s = cos[k] * scale, sin[k] * scale
        for p in range(points.shape[0]):
            out[k, p, 0] = int(np.floor(c * points[p, 0] - s * points[p, 1] + x * scale))
            out[k, p, 1] = int(np.floor(s * points[p, 0] + c * points[p, 1] + y * scale))


@njit(cache=True, nogil=True)
def _locate(search, level, run):  # type: ignore[no-untyped-def]
    """Fill in where a run's points look: table and plane, row and column for the first node.

    Returns:
        The index of the run among those of all levels.
    """
    cells, shape, starts, where, ranges = search
    at = starts[level] + run
    if ranges[at, 4] == 1:
        return at
    length = min(1 << level, shape[7])
    first, stop = run * length, min((run + 1) * length, shape[2])
    square, size, margin = 1 << level, shape[4] * shape[5], shape[3]
    height, width = shape[4] >> level, shape[5] >> level
    low_row = low_col = np.int64(1 << 60)
    high_row = high_col = -np.int64(1 << 60)
    for p in range(cells.shape[1]):
        left = right = np.int64(cells[first, p, 0])
        down = up = np.int64(cells[first, p, 1])
        for k in range(first + 1, stop):
            col, row = np.int64(cells[k, p, 0]), np.int64(cells[k, p, 1])
            left, right = min(left, col), max(right, col)
            down, up = min(down, row), max(up, row)
        spread, table = max(right - left, up - down), 0
        while SPREADS[table] < spread:
            table += 1
        left, down = left + margin, down + margin
        plane = (down & (square - 1)) * square + (left & (square - 1))
        row, col = down >> level, left >> level
        where[at, p, 0] = ((level - 1) * len(SPREADS) + table) * size + plane * height * width
        where[at, p, 1], where[at, p, 2] = row, col
        low_row, high_row = min(low_row, row), max(high_row, row)
        low_col, high_col = min(low_col, col), max(high_col, col)
    ranges[at, 0], ranges[at, 1], ranges[at, 2], ranges[at, 3] = (
        low_row,
        high_row,
        low_col,
        high_col,
    )
    ranges[at, 4] = 1
    return at


@njit(cache=True, nogil=True)
def _add_tables(bounds, search, level, first, stop, total, tops):  # type: ignore[no-untyped-def]  # noqa: C901
    """Bound a level's nodes of the runs from `first` to before `stop`.

    A table is added as one line: the nodes of a row that look past its end find the next row, which
    makes their bound no smaller than it should be.
    """
    shape, where = search[1], search[3]
    height, width = shape[4] >> level, shape[5] >> level
    rows, cols = tops.shape[1], tops.shape[2]
    length, count = total.shape[0], where.shape[1]
    four = np.zeros(4, dtype=np.int64)
    for run in range(first, stop):
        at = _locate(search, level, run)
        if length == 0:
            for i in range(0, rows, 2):
                for j in range(0, cols, 2):
                    _four_bounds(bounds, search, level, at, i, j, four)
                    for k in range(4):
                        if i + k // 2 < rows and j + k % 2 < cols:
                            tops[run, i + k // 2, j + k % 2] = four[k]
            continue
        for block in range(0, count, 256):
            for q in range(length):
                total[q] = 0
            for p in range(block, min(block + 256, count)):
                shift = where[at, p, 1] * width + where[at, p, 2]
                low, high = max(0, -shift), min(length, height * width - shift)
                if high > low:
                    source = where[at, p, 0] + shift
                    line = bounds[source + low : source + high]
                    onto = total[low:high]
                    for q in range(high - low):
                        onto[q] += line[q]
            for i in range(rows):
                for j in range(cols):
                    tops[run, i, j] += total[i * width + j]


@njit(cache=True, nogil=True)
def _four_bounds(bounds, search, level, at, i, j, out):  # type: ignore[no-untyped-def]
    """Bounds of the nodes (i, j), (i, j + 1), (i + 1, j) and (i + 1, j + 1) of a run."""
    shape, where, ranges = search[1], search[3], search[4]
    height, width = shape[4] >> level, shape[5] >> level
    a = b = c = d = 0
    if (
        ranges[at, 0] + i >= 0
        and ranges[at, 1] + i + 1 < height
        and ranges[at, 2] + j >= 0
        and ranges[at, 3] + j + 1 < width
    ):
        shift = i * width + j
        for p in range(where.shape[1]):
            q = where[at, p, 0] + where[at, p, 1] * width + where[at, p, 2] + shift
            a += bounds[q]
            b += bounds[q + 1]
            c += bounds[q + width]
            d += bounds[q + width + 1]
    else:
        for p in range(where.shape[1]):
            row, col = where[at, p, 1] + i, where[at, p, 2] + j
            q = where[at, p, 0] + row * width + col
            low, high = 0 <= row < height, 0 <= row + 1 < height
            left, right = 0 <= col < width, 0 <= col + 1 < width
            if low and left:
                a += bounds[q]
            if low and right:
                b += bounds[q + 1]
            if high and left:
                c += bounds[q + width]
            if high and right:
                d += bounds[q + width + 1]
    out[0], out[1], out[2], out[3] = a, b, c, d


@njit(cache=True, nogil=True)
def _score_four(values, search, heading, i, j, best):  # type: ignore[no-untyped-def]
    """Score the poses (i, j) to (i + 1, j + 1) at a heading; keep the best in `best`."""
    cells, shape = search[0], search[1]
    height, width = values.shape
    a = b = c = d = 0.0
    for p in range(cells.shape[1]):
        row, col = np.int64(cells[heading, p, 1]) + i, np.int64(cells[heading, p, 0]) + j
        if 0 <= row < height - 1 and 0 <= col < width - 1:
            a += values[row, col]
            b += values[row, col + 1]
            c += values[row + 1, col]
            d += values[row + 1, col + 1]
        elif -1 <= row < height and -1 <= col < width:
            if row >= 0 and col >= 0:
                a += values[row, col]
            if row >= 0 and col + 1 < width:
                b += values[row, col + 1]
            if row + 1 < height and col >= 0:
                c += values[row + 1, col]
            if row + 1 < height and col + 1 < width:
                d += values[row + 1, col + 1]
    for k in range(4):
        score = a if k == 0 else b if k == 1 else c if k == 2 else d
        row, col = i + k // 2, j + k % 2
        if score > best[0] and row < shape[0] and col < shape[1]:
            best[0], best[1], best[2], best[3] = score, row, col, heading


@njit(cache=True, nogil=True)
def _descend(values, bounds, search, top, nodes, tops, best):  # type: ignore[no-untyped-def]  # noqa: C901
    """Go down from nodes, the most promising child first, and keep the best pose.

    Args:
        values: (H, W) of the field.
        bounds: of the pyramid.
        search: lattice and room.
        top: their level.
        nodes: (M,) their numbers, flat over runs, rows and columns.
        tops: (M,) their bounds.
        best: summed score, row, column, heading, nodes bounded; kept up to date.
    """
    shape = search[1]
    longest = shape[7]
    square = 1 << top
    rows, cols = (shape[0] + square - 1) // square, (shape[1] + square - 1) // square
    stack = np.empty((8 * LEVELS + 1, 5), dtype=np.int64)
    four = np.zeros(4, dtype=np.int64)
    for n in range(nodes.shape[0]):
        if tops[n] <= best[0] * BYTE:
            continue
        node = nodes[n]
        stack[0, 0], stack[0, 1], stack[0, 2] = top, node // (rows * cols), node // cols % rows
        stack[0, 3], stack[0, 4] = node % cols, tops[n]
        depth = 1
        while depth > 0:
            depth -= 1
            if stack[depth, 4] <= best[0] * BYTE:
                continue
            level, run = stack[depth, 0] - 1, stack[depth, 1]
            i, j = 2 * stack[depth, 2], 2 * stack[depth, 3]
            parts = min(1 << (level + 1), longest) // min(1 << level, longest)
            length = min(1 << level, longest)
            bottom = depth
            for part in range(parts):
                child = run * parts + part
                if child * length >= shape[2]:
                    continue
                best[4] += 4
                if level == 0:
                    _score_four(values, search, child, i, j, best)
                    continue
                at = _locate(search, level, child)
                _four_bounds(bounds, search, level, at, i, j, four)
                for k in range(4):
                    row, col = i + k // 2, j + k % 2
                    inside = row << level < shape[0] and col << level < shape[1]
                    if not inside or four[k] <= best[0] * BYTE:
                        continue
                    # The children lie on the stack in the order of their bounds, the best on top.
                    place = depth
                    while place > bottom and stack[place - 1, 4] > four[k]:
                        for m in range(5):
                            stack[place, m] = stack[place - 1, m]
                        place -= 1
                    stack[place, 0], stack[place, 1], stack[place, 2] = level, child, row
                    stack[place, 3], stack[place, 4] = col, four[k]
                    depth += 1
