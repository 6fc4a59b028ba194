"""Points made ready to be registered against: short lines, one for each cell that holds points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array

#: Edge of a cell, m, and how many cells at most; points spread farther get larger cells.
CELL_M, MOST_CELLS = 0.1, 4_000_000
#: A line is laid through the points of the first square of cells that holds enough of them, so
#: many cells to each side, unless they are too little of a line: variance across over along.
_RINGS = np.array([1, 2, 4, 8])
_LEAST_POINTS, _ROUND = 6, 0.05


@dataclass(frozen=True, eq=False)
class LineTarget:
    """N short lines in one frame. Points that lie on no line are left out.

    Attributes:
        points: (N, 2) m, mean of a cell's points.
        normals: (N, 2) unit vectors across the lines, of either sign.
        off: (N,) m, how far the points lie off their lines, along the normals.
        variance: (N,) rad^2 by which a normal's direction is uncertain.
        count: (N,) how many points of the cloud a cell holds.
        index: (rows, columns) int32 which line a cell has, -1 for none.
        cell_m: edge of a cell.
        corner_xy: (2,) m, lower left corner of the first cell.
    """

    points: Array
    normals: Array
    off: Array
    variance: Array
    count: Array
    index: NDArray[np.int32]
    cell_m: float
    corner_xy: Array


def line_target(points: Array) -> LineTarget:
    """Lay lines through points (N, 2), m, all finite.

    A line is the principal axis of its points. The variance of its direction is that of the slope
    of a fitted line, s^2 / (n v), with s^2 the points' variance across it and v along it.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    corner, extent = np.zeros(2), np.zeros(2)
    if len(points):
        corner = points.min(axis=0)
        extent = points.max(axis=0) - corner
    cell = max(CELL_M, float(np.sqrt(np.prod(extent + CELL_M) / MOST_CELLS)), extent.max() * 1e-6)
    columns, rows = ((extent / cell).astype(np.int64) + 1).tolist()
    index = np.full((rows, columns), -1, dtype=np.int32)
    sums = np.zeros((len(points), 9))
    found = np.zeros((len(points), 7))
    lines = found[: _lay_lines(points, index, cell, corner, _RINGS, sums, found)]
    points, normals = lines[:, :2].copy(), lines[:, 2:4].copy()
    off, variance, count = (lines[:, k].copy() for k in (4, 5, 6))
    return LineTarget(points, normals, off, variance, count, index, cell, corner)


@njit(cache=True, nogil=True)
def _lay_lines(points, index, cell, corner, rings, sums, found):  # type: ignore[no-untyped-def]  # noqa: C901
    """Write what is told of the lines into `found`, and their numbers into `index`; how many.

    `sums` hold, of each cell: column, row, count, sums of x, y, xx, xy, yy about its middle, line.
    """
    occupied = 0
    for p in range(points.shape[0]):
        u, v = (points[p, 0] - corner[0]) / cell, (points[p, 1] - corner[1]) / cell
        col, row = int(u), int(v)
        k = index[row, col]
        if k < 0:
            k = occupied
            index[row, col] = k
            sums[k, 0], sums[k, 1], sums[k, 8] = col, row, -1.0
            occupied += 1
        dx, dy = u - col - 0.5, v - row - 0.5
        sums[k, 2] += 1.0
        sums[k, 3] += dx
        sums[k, 4] += dy
        sums[k, 5] += dx * dx
        sums[k, 6] += dx * dy
        sums[k, 7] += dy * dy
    lines = 0
    for k in range(occupied):
        col, row = int(sums[k, 0]), int(sums[k, 1])
        for ring in rings:
            n = sx = sy = sxx = sxy = syy = 0.0
            left, right = max(col - ring, 0), min(col + ring, index.shape[1] - 1)
            for r in range(max(row - ring, 0), min(row + ring, index.shape[0] - 1) + 1):
                for c in range(left, right + 1):
                    m = index[r, c]
                    if m < 0:
                        continue
                    dx, dy, count = c - col, r - row, sums[m, 2]
                    n += count
                    sx += sums[m, 3] + dx * count
                    sy += sums[m, 4] + dy * count
                    sxx += sums[m, 5] + dx * (2.0 * sums[m, 3] + dx * count)
                    sxy += sums[m, 6] + dx * sums[m, 4] + dy * sums[m, 3] + dx * dy * count
                    syy += sums[m, 7] + dy * (2.0 * sums[m, 4] + dy * count)
            if n < _LEAST_POINTS:
                continue
            mx, my = sx / n, sy / n
            xx, xy, yy = sxx / n - mx * mx, sxy / n - mx * my, syy / n - my * my
            root = np.sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)
            along, across = 0.5 * (xx + yy) + root, max(0.5 * (xx + yy) - root, 1e-9)
            if across > _ROUND * along:
                continue
            angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
            nx, ny = -np.sin(angle), np.cos(angle)
            x, y = sums[k, 3] / sums[k, 2], sums[k, 4] / sums[k, 2]
            found[lines, 0] = corner[0] + (col + 0.5 + x) * cell
            found[lines, 1] = corner[1] + (row + 0.5 + y) * cell
            found[lines, 2], found[lines, 3] = nx, ny
            found[lines, 4] = (nx * (x - mx) + ny * (y - my)) * cell
            found[lines, 5], found[lines, 6] = across / (along * n), sums[k, 2]
            sums[k, 8] = lines
            lines += 1
            break
    # Until here the index held the cells' own numbers, which their neighbours went by.
    for k in range(occupied):
        index[int(sums[k, 1]), int(sums[k, 0])] = int(sums[k, 8])
    return lines
