"""The loops under branch and bound, compiled.

They stand in one file because numba compiles a cached kernel again when its own file changes, and
not when that of a kernel it calls, or of a constant it was compiled with, does.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from slamreplay.matching.pyramid import BYTE, LEVELS, SPREADS


@njit(cache=True, nogil=True)
def cells(points, cos, sin, x, y, resolution, out):  # type: ignore[no-untyped-def]
    """Write the column and row of each point at each heading, seen from (x, y)."""
    scale = 1.0 / resolution
    for k in range(cos.shape[0]):
        c, s = cos[k] * scale, sin[k] * scale
        for p in range(points.shape[0]):
            out[k, p, 0] = int(np.floor(c * points[p, 0] - s * points[p, 1] + x * scale))
            out[k, p, 1] = int(np.floor(s * points[p, 0] + c * points[p, 1] + y * scale))


@njit(cache=True, nogil=True)
def locate(search, level, run):  # type: ignore[no-untyped-def]
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
def add_tables(bounds, search, level, first, stop, total, tops):  # type: ignore[no-untyped-def]  # noqa: C901
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
        at = locate(search, level, run)
        if length == 0:
            for i in range(0, rows, 2):
                for j in range(0, cols, 2):
                    four_bounds(bounds, search, level, at, i, j, four)
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
def four_bounds(bounds, search, level, at, i, j, out):  # type: ignore[no-untyped-def]
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
def score_four(values, search, heading, i, j, best):  # type: ignore[no-untyped-def]
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
def descend(values, bounds, search, top, nodes, tops, best):  # type: ignore[no-untyped-def]  # noqa: C901
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
                    score_four(values, search, child, i, j, best)
                    continue
                at = locate(search, level, child)
                four_bounds(bounds, search, level, at, i, j, four)
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
