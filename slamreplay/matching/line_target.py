"""Points made ready to be registered against: sorted into cells, each with the line it lies on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array

#: Edge of a cell, m, and how many cells at most; a farther spread of points gets larger cells.
CELL_M, MOST_CELLS = 0.1, 1_000_000
#: A line is laid through the points within the first of these radii that holds enough of them,
#: unless they are too little of a line: the ratio of their variances across and along.
_RADII_M = np.array([0.15, 0.3, 0.6, 1.2])
_LEAST_POINTS, _ROUND = 6, 0.05


@dataclass(frozen=True, eq=False)
class LineTarget:
    """N points in one frame, of which each lies on a line: those that lie on none are left out.

    Attributes:
        points: (N, 2) m, in the order of their cells.
        normals: (N, 2) unit vectors across the lines, of either sign.
        variance: (N,) rad^2 by which a normal's direction is uncertain.
        starts: (rows * columns + 1,) first point of each cell, row by row.
        cell_m: edge of a cell.
        corner_xy: (2,) m, lower left corner of the first cell.
        columns: of the cells.
    """

    points: Array
    normals: Array
    variance: Array
    starts: NDArray[np.int64]
    cell_m: float
    corner_xy: Array
    columns: int


def line_target(points: Array) -> LineTarget:
    """Sort points (N, 2), m, into cells and lay a line through the neighbours of each.

    The direction of a line is the principal axis of its points; its variance is that of the slope
    of a line fitted to them, s^2 / (n v), with s^2 their variance across it and v along it.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    order, starts, cell, corner, columns = _sorted(points)
    normals, variance = np.zeros((len(points), 2)), np.zeros(len(points))
    points = points[order]
    _lay_lines(points, starts, cell, corner, columns, _RADII_M, normals, variance)
    on_line = variance > 0.0
    kept = np.append(0, np.cumsum(on_line))[starts]
    return LineTarget(
        points[on_line], normals[on_line], variance[on_line], kept, cell, corner, columns
    )


def _sorted(
    points: Array,
) -> tuple[NDArray[np.int64], NDArray[np.int64], float, Array, int]:
    """Order of the points by cell, starts of the cells, their edge, first corner and columns."""
    if not len(points):
        return np.zeros(0, np.int64), np.zeros(2, np.int64), CELL_M, np.zeros(2), 1
    corner = points.min(axis=0)
    extent = points.max(axis=0) - corner
    cell = max(CELL_M, float(np.sqrt(np.prod(extent + CELL_M) / MOST_CELLS)), extent.max() * 1e-6)
    columns, rows = ((extent / cell).astype(np.int64) + 1).tolist()
    at = ((points - corner) / cell).astype(np.int64)
    number = at[:, 1] * columns + at[:, 0]
    order = np.argsort(number, kind="stable")
    starts = np.append(0, np.cumsum(np.bincount(number, minlength=rows * columns)))
    return order, starts.astype(np.int64), cell, corner, columns


@njit(cache=True, nogil=True)
def _lay_lines(points, starts, cell, corner, columns, radii, normals, variance):  # type: ignore[no-untyped-def]
    """Write the normal of each point's line, and its variance; that stays 0 where there is none."""
    rows = (starts.shape[0] - 1) // columns
    for p in range(points.shape[0]):
        x, y = points[p, 0], points[p, 1]
        col, row = int((x - corner[0]) / cell), int((y - corner[1]) / cell)
        for k in range(radii.shape[0]):
            ring, limit = int(np.ceil(radii[k] / cell)), radii[k] * radii[k]
            count, sx, sy, sxx, sxy, syy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
            left, right = max(col - ring, 0), min(col + ring, columns - 1)
            for r in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
                for q in range(starts[r * columns + left], starts[r * columns + right + 1]):
                    dx, dy = points[q, 0] - x, points[q, 1] - y
                    if dx * dx + dy * dy <= limit:
                        count += 1
                        sx += dx
                        sy += dy
                        sxx += dx * dx
                        sxy += dx * dy
                        syy += dy * dy
            if count < _LEAST_POINTS:
                continue
            mx, my = sx / count, sy / count
            xx, xy, yy = sxx / count - mx * mx, sxy / count - mx * my, syy / count - my * my
            half, middle = 0.5 * (xx - yy), 0.5 * (xx + yy)
            root = np.sqrt(half * half + xy * xy)
            along, across = middle + root, max(middle - root, 1e-12)
            if across > _ROUND * along:
                continue
            angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
            normals[p, 0], normals[p, 1] = -np.sin(angle), np.cos(angle)
            variance[p] = across / (along * count)
            break
