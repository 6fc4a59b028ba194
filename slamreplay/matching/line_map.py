"""A map of short lines that forgets, and the match of a scan to it by its lines (point to line).

The map is a torus of square cells, so that it follows the robot without being moved; a cell that
was last seen too long ago counts as empty. A cell holds up to two lines, for the two faces of a
thin wall. The match is Gauss and Newton's on the distances of the scan's points from the lines
nearest to them (Chen and Medioni 1992; Censi, An ICP variant using a point-to-line metric, ICRA
2008) with Welsch's weights, which let a point that fits nothing count nothing, and a Gaussian
prior.

Points that lie on no line hold nothing: the farthest beams of a bare corridor end far apart, and
if each were held to the last one near it, the robot would be, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array

CELL_M = 0.1
#: Cells along one side of the torus, a power of two.
SIDE = 1024
#: A line is the mean of at most so many sightings, so that it can still follow.
MOST_SIGHTINGS = 20.0
#: Faces farther apart than this (cosine) are not those of one surface.
SAME_FACE = 0.5
#: Steps are kept within these, m and rad; the first ones look for lines one cell farther away.
MOST_M, MOST_RAD, WIDE_STEPS = 0.2, 0.1, 4
#: A step this small is the last, m.
SMALL = 2e-4
#: Width of a point's score.
SCORE_M = 0.08


@dataclass(eq=False)
class LineMap:
    """The map.

    Attributes:
        tags: (SIDE^2, 2, 3) int32 column, row and number of the node that last saw it; per face.
        lines: (SIDE^2, 2, 5) x, y, normal x and y (0 where it is only a point), sightings.
        now: number of the node that came last.
        memory: lines that none of so many nodes have seen are forgotten.
    """

    tags: NDArray[np.int32]
    lines: Array
    now: int
    memory: int

    @classmethod
    def empty(cls, memory: int) -> LineMap:
        """A map without lines."""
        tags = np.zeros((SIDE * SIDE, 2, 3), dtype=np.int32)
        return cls(tags, np.zeros((SIDE * SIDE, 2, 5)), memory + 1, memory)

    def add(self, pose: Array, points: Array, normals: Array) -> float:
        """Take in the lines of a node at its pose (3,); the share of the points that begin one."""
        self.now += 1
        new = insert(self.tags, self.lines, self.now, self.memory, pose, points, normals)
        return new / max(len(points), 1)

    def clear(self) -> None:
        """Forget everything."""
        self.now += self.memory + 1

    def points(self, centre_xy: Array, radius_m: float) -> Array:
        """(M, 2) what it holds in a square about a place (2,)."""
        reach = int(radius_m / CELL_M)
        out = np.empty((2 * (2 * reach + 1) ** 2, 2))
        corner = np.floor(centre_xy / CELL_M).astype(np.int64) - reach
        oldest = self.now - self.memory
        return out[: _collect(self.tags, self.lines, oldest, corner, 2 * reach + 1, out)].copy()


@njit(cache=True, nogil=True)
def insert(tags, lines, now, memory, pose, points, normals):  # type: ignore[no-untyped-def]
    """Merge each point with the line of its cell that faces as it does; how many begin one."""
    new = 0
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for p in range(points.shape[0]):
        x = pose[0] + cos * points[p, 0] - sin * points[p, 1]
        y = pose[1] + sin * points[p, 0] + cos * points[p, 1]
        nx = cos * normals[p, 0] - sin * normals[p, 1]
        ny = sin * normals[p, 0] + cos * normals[p, 1]
        is_line = nx != 0.0 or ny != 0.0
        col, row = int(np.floor(x / CELL_M)), int(np.floor(y / CELL_M))
        at = (row & (SIDE - 1)) * SIDE + (col & (SIDE - 1))
        into, merge = -1, False
        for face in range(2):
            tag = tags[at, face]
            fresh = tag[0] == col and tag[1] == row and tag[2] >= now - memory
            if not fresh:
                into = face if into < 0 else into
                continue
            line = lines[at, face]
            theirs = line[2] != 0.0 or line[3] != 0.0
            if is_line and theirs and line[2] * nx + line[3] * ny < SAME_FACE:
                continue
            into, merge = face, True
            break
        if into < 0:
            into = 0 if tags[at, 0, 2] <= tags[at, 1, 2] else 1
        line, tag = lines[at, into], tags[at, into]
        if not merge:
            new += 1
            line[0], line[1], line[2], line[3], line[4] = x, y, nx, ny, 1.0
        else:
            theirs = line[2] != 0.0 or line[3] != 0.0
            if theirs and not is_line:
                tag[2] = now
                continue
            if is_line and not theirs:
                line[4] = 0.0
            count = line[4] = min(line[4] + 1.0, MOST_SIGHTINGS)
            line[0] += (x - line[0]) / count
            line[1] += (y - line[1]) / count
            if is_line:
                line[2] += (nx - line[2]) / count
                line[3] += (ny - line[3]) / count
                length = np.hypot(line[2], line[3])
                line[2] /= length
                line[3] /= length
        tag[0], tag[1], tag[2] = col, row, now
    return new


@njit(cache=True, nogil=True)
def _collect(tags, lines, oldest, corner, side, out):  # type: ignore[no-untyped-def]
    """Write the places of the lines in a square of cells; how many."""
    count = 0
    for row in range(corner[1], corner[1] + side):
        for col in range(corner[0], corner[0] + side):
            at = (row & (SIDE - 1)) * SIDE + (col & (SIDE - 1))
            for face in range(2):
                tag = tags[at, face]
                if tag[2] >= oldest and tag[0] == col and tag[1] == row:
                    out[count, 0], out[count, 1] = lines[at, face, 0], lines[at, face, 1]
                    count += 1
    return count


@njit(cache=True, nogil=True)
def _nearest(tags, lines, oldest, x, y, nx, ny, reach):  # type: ignore[no-untyped-def]
    """The nearest line within `reach` cells that may be the same surface: its place, or -1."""
    col, row = int(np.floor(x / CELL_M)), int(np.floor(y / CELL_M))
    is_line = nx != 0.0 or ny != 0.0
    best, found = np.inf, -1
    for r in range(row - reach, row + reach + 1):
        for c in range(col - reach, col + reach + 1):
            at = (r & (SIDE - 1)) * SIDE + (c & (SIDE - 1))
            for face in range(2):
                if tags[at, face, 2] < oldest or tags[at, face, 0] != c or tags[at, face, 1] != r:
                    continue
                dx, dy = x - lines[at, face, 0], y - lines[at, face, 1]
                off = dx * dx + dy * dy
                if off < best:
                    same = lines[at, face, 2] * nx + lines[at, face, 3] * ny
                    theirs = lines[at, face, 2] != 0.0 or lines[at, face, 3] != 0.0
                    if is_line and theirs and same < SAME_FACE:
                        continue
                    best, found = off, 2 * at + face
    return found


@njit(cache=True, nogil=True)
def align(tags, lines, oldest, points, normals, pose, prior, held, sigma, variance, steps, out):  # type: ignore[no-untyped-def]
    """Move `pose` to where the points lie on the lines and the prior allows.

    Args:
        tags: of the map.
        lines: of the map.
        oldest: number of the first node that still counts.
        points: (P, 2) of the scan, m.
        normals: (P, 2).
        pose: (3,) first guess, moved in place; its yaw is not wrapped.
        prior: (3,) where it is expected.
        held: (3, 3) information of that.
        sigma: standard deviation of a point about its line, m: Welsch's weights begin with four
            times and end with twice as much.
        variance: of a point that counts for one, m^2.
        steps: at the most; 0 only sums up at `pose`.
        out: (4, 3) written: information of the match were the variance of a point 1, and scratch.

    Returns:
        Mean score of the points, mean weighted square of their distances (m^2), and how far the
        prior was trusted: Student's weight for 4 degrees of freedom, 1 where it fits.
    """
    width, trust, is_done, turn = 4.0 * sigma, 1.0, False, 0
    while True:
        # One call, for each would be compiled by itself.
        reach = 2 if turn <= WIDE_STEPS else 1
        score, squares = _sum_up(tags, lines, oldest, points, normals, pose, width, reach, out)
        if is_done or turn == steps:
            return score, squares, trust
        trust, moved = _step(out, variance, prior, held, pose)
        narrow = max(2.0 * sigma, 0.7 * width)
        is_done = moved < SMALL and narrow == width and turn >= WIDE_STEPS
        width, turn = narrow, turn + 1


@njit(cache=True, nogil=True)
def _sum_up(tags, lines, oldest, points, normals, pose, width, reach, out):  # type: ignore[no-untyped-def]
    """Write the normal equations of a pose into `out`; mean score and mean weighted square."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    xx = xy = xt = yy = yt = tt = 0.0
    bx = by = bt = 0.0
    score = squares = weights = 0.0
    for p in range(points.shape[0]):
        rx = cos * points[p, 0] - sin * points[p, 1]
        ry = sin * points[p, 0] + cos * points[p, 1]
        nx = cos * normals[p, 0] - sin * normals[p, 1]
        ny = sin * normals[p, 0] + cos * normals[p, 1]
        x, y = pose[0] + rx, pose[1] + ry
        found = _nearest(tags, lines, oldest, x, y, nx, ny, reach)
        if found < 0:
            continue
        line = lines[found // 2, found % 2]
        dx, dy = x - line[0], y - line[1]
        if line[2] == 0.0 and line[3] == 0.0:
            score += np.exp(-0.5 * (dx * dx + dy * dy) / (SCORE_M * SCORE_M))
            continue
        off = line[2] * dx + line[3] * dy
        w = np.exp(-0.5 * off * off / (width * width))
        lever = line[3] * rx - line[2] * ry
        xx += w * line[2] * line[2]
        xy += w * line[2] * line[3]
        yy += w * line[3] * line[3]
        xt += w * line[2] * lever
        yt += w * line[3] * lever
        tt += w * lever * lever
        bx -= w * line[2] * off
        by -= w * line[3] * off
        bt -= w * lever * off
        squares += w * off * off
        weights += w
        score += np.exp(-0.5 * off * off / (SCORE_M * SCORE_M))
    out[0, 0], out[0, 1], out[0, 2] = xx, xy, xt
    out[1, 0], out[1, 1], out[1, 2] = xy, yy, yt
    out[2, 0], out[2, 1], out[2, 2] = xt, yt, tt
    out[3, 0], out[3, 1], out[3, 2] = bx, by, bt
    return score / max(points.shape[0], 1), squares / max(weights, 1e-9)


@njit(cache=True, nogil=True)
def _step(sums, variance, prior, held, pose):  # type: ignore[no-untyped-def]
    """One step of Gauss and Newton; the weight of the prior, and how far it went (m or rad)."""
    ex, ey = prior[0] - pose[0], prior[1] - pose[1]
    et = (prior[2] - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
    gx = held[0, 0] * ex + held[0, 1] * ey + held[0, 2] * et
    gy = held[0, 1] * ex + held[1, 1] * ey + held[1, 2] * et
    gt = held[0, 2] * ex + held[1, 2] * ey + held[2, 2] * et
    trust = min(1.0, 7.0 / (4.0 + ex * gx + ey * gy + et * gt))
    a00, a01 = (
        sums[0, 0] / variance + trust * held[0, 0],
        sums[0, 1] / variance + trust * held[0, 1],
    )
    a02, a11 = (
        sums[0, 2] / variance + trust * held[0, 2],
        sums[1, 1] / variance + trust * held[1, 1],
    )
    a12, a22 = (
        sums[1, 2] / variance + trust * held[1, 2],
        sums[2, 2] / variance + trust * held[2, 2],
    )
    b0, b1 = sums[3, 0] / variance + trust * gx, sums[3, 1] / variance + trust * gy
    b2 = sums[3, 2] / variance + trust * gt
    c00, c01, c02 = a11 * a22 - a12 * a12, a12 * a02 - a01 * a22, a01 * a12 - a11 * a02
    c11, c12, c22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    det = a00 * c00 + a01 * c01 + a02 * c02
    if not det > 0.0:
        return trust, 0.0
    s0 = min(max((c00 * b0 + c01 * b1 + c02 * b2) / det, -MOST_M), MOST_M)
    s1 = min(max((c01 * b0 + c11 * b1 + c12 * b2) / det, -MOST_M), MOST_M)
    s2 = min(max((c02 * b0 + c12 * b1 + c22 * b2) / det, -MOST_RAD), MOST_RAD)
    pose[0] += s0
    pose[1] += s1
    pose[2] += s2
    return trust, max(abs(s0), abs(s1), 2.0 * abs(s2))
