"""Many pairs of scans laid on each other at once: one step of point to line for each.

What a step leaves is the least-squares problem that it solved, so that a graph of all pairs can
weigh each as its points hold it, and can be solved before the next step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.matching.threads import share_out

#: Faces farther apart than this (cosine) are not those of one surface.
SAME_FACE = 0.5
#: Squared sines by which normals err: information as if from nothing, taken off again.
NORMAL_NOISE = 0.01
#: What a step may move at the most, m and rad.
MOST_M, MOST_RAD = 0.3, 0.1
_WORTH_A_THREAD = 256


@dataclass(frozen=True, eq=False)
class ScanLines:
    """The points of K scans with the way that surfaces face there, each sorted by its bearing.

    Attributes:
        points: (P, 2) in the frame of their own scan, m.
        normals: (P, 2) unit; 0 where there is no line.
        bearings: (P,) from the laser, rad.
        bounds: (K + 1,) first point of each scan, and P.
        laser_xy: (2,) where the beams start.
    """

    points: se2.Array
    normals: se2.Array
    bearings: se2.Array
    bounds: NDArray[np.int64]
    laser_xy: se2.Array

    @classmethod
    def of(
        cls, points: Sequence[se2.Array], normals: Sequence[se2.Array], laser_xy: se2.Array
    ) -> ScanLines:
        """Of K arrays (M, 2) each, whose laser sat at `laser_xy` (2,)."""
        bounds = np.cumsum([0, *map(len, points)], dtype=np.int64)
        ends = np.concatenate([np.empty((0, 2)), *points])
        faces = np.concatenate([np.empty((0, 2)), *normals])
        bearings = np.arctan2(ends[:, 1] - laser_xy[1], ends[:, 0] - laser_xy[0])
        order = np.lexsort((bearings, np.repeat(np.arange(len(points)), np.diff(bounds))))
        return cls(ends[order], faces[order], bearings[order], bounds, np.asarray(laser_xy))


@dataclass(frozen=True, eq=False)
class Laid:
    """What one step says of each of E pairs.

    Attributes:
        xyyaw: (E, 3) pose of the second scan in the first after it.
        per_point: (E, 3, 3) information of x y yaw about axes of the first where a point's variance
            is 1; none along directions that the lines do not hold.
        share: (E,) of the second's points that have a partner.
        rms_m: (E,) of the points' distances from their lines, weighted.
    """

    xyyaw: se2.Array
    per_point: se2.Array
    share: se2.Array
    rms_m: se2.Array


def lay_pairs(
    lines: ScanLines, pairs: NDArray[np.int64], xyyaw: se2.Array, reach_m: float, width_m: float
) -> Laid:
    """Move the second scan of each pair towards the lines of the first, by one step.

    Args:
        lines: the scans.
        pairs: (E, 2) numbers of scans.
        xyyaw: (E, 3) where the second lies in the first.
        reach_m: points farther than this from all of the first have no partner.
        width_m: a distance of so much counts half (Cauchy's weight).
    """
    count = len(pairs)
    sums = np.zeros((count, 13))
    pairs, xyyaw = np.ascontiguousarray(pairs), np.ascontiguousarray(xyyaw)

    def work(first: int, stop: int) -> None:
        _sum_pairs(
            lines.points, lines.normals, lines.bearings, lines.bounds, lines.laser_xy,
            pairs[first:stop], xyyaw[first:stop], reach_m, width_m, sums[first:stop],
        )  # fmt: skip

    if count:
        share_out(count, work, _WORTH_A_THREAD)
    H = np.empty((count, 3, 3))
    H[:, 0, 0], H[:, 1, 1], H[:, 2, 2] = sums[:, 0], sums[:, 1], sums[:, 2]
    H[:, 0, 1] = H[:, 1, 0] = sums[:, 3]
    H[:, 0, 2] = H[:, 2, 0] = sums[:, 4]
    H[:, 1, 2] = H[:, 2, 1] = sums[:, 5]
    # In units in which all three are lengths, so that directions can be told apart.
    lever = np.sqrt(np.maximum(sums[:, 10] / np.maximum(sums[:, 9], 1e-9), 0.01))
    unit = np.stack([np.ones(count), np.ones(count), lever], axis=1)
    value, vector = np.linalg.eigh(H / (unit[:, :, None] * unit[:, None, :]))
    held = np.maximum(value - NORMAL_NOISE * sums[:, 9:10], 0.0)
    along = np.einsum("eij,ei->ej", vector, sums[:, 6:9] / unit)
    # A direction that holds little moves little, as Levenberg's damping has it.
    step = np.einsum("eij,ej->ei", vector, along * held / np.maximum(value, 1e-9) ** 2) / unit
    most = np.array([MOST_M, MOST_M, MOST_RAD])
    moved = xyyaw + np.clip(step, -most, most)
    moved[:, 2] = se2.wrap_angle(moved[:, 2])
    vector = vector * unit[:, :, None]
    total = np.maximum(np.diff(lines.bounds)[pairs[:, 1]], 1)
    return Laid(
        moved,
        np.asarray((vector * held[:, None, :]) @ np.swapaxes(vector, 1, 2)),
        sums[:, 12] / total,
        np.sqrt(sums[:, 11] / np.maximum(sums[:, 9], 1e-9)),
    )


@njit(cache=True, nogil=True)
def _sum_pairs(  # type: ignore[no-untyped-def]
    points, normals, bearings, bounds, laser, pairs, poses, reach, width, sums
):
    """Normal equations: xx yy tt xy xt yt, x y t, then weight, levers, squares, partners."""
    for e in range(pairs.shape[0]):
        begin, end = bounds[pairs[e, 0]], bounds[pairs[e, 0] + 1]
        cos, sin = np.cos(poses[e, 2]), np.sin(poses[e, 2])
        out = sums[e]
        for p in range(bounds[pairs[e, 1]], bounds[pairs[e, 1] + 1]):
            rx = cos * points[p, 0] - sin * points[p, 1]
            ry = sin * points[p, 0] + cos * points[p, 1]
            x, y = poses[e, 0] + rx, poses[e, 1] + ry
            fx = cos * normals[p, 0] - sin * normals[p, 1]
            fy = sin * normals[p, 0] + cos * normals[p, 1]
            q = _nearest(points, normals, bearings, begin, end, laser, x, y, fx, fy, reach)
            if q < 0:
                continue
            out[12] += 1.0
            nx, ny = normals[q, 0], normals[q, 1]
            if (nx == 0.0 and ny == 0.0) or (fx == 0.0 and fy == 0.0):
                continue
            off = nx * (x - points[q, 0]) + ny * (y - points[q, 1])
            w = 1.0 / (1.0 + off * off / (width * width))
            lever = ny * rx - nx * ry
            out[0] += w * nx * nx
            out[1] += w * ny * ny
            out[2] += w * lever * lever
            out[3] += w * nx * ny
            out[4] += w * nx * lever
            out[5] += w * ny * lever
            out[6] -= w * nx * off
            out[7] -= w * ny * off
            out[8] -= w * lever * off
            out[9] += w
            out[10] += w * (rx * rx + ry * ry)
            out[11] += w * off * off


@njit(cache=True, nogil=True)
def _nearest(points, normals, bearings, begin, end, laser, x, y, fx, fy, reach):  # type: ignore[no-untyped-def]
    """The nearest point of a scan within reach whose surface may be the same: its number, or -1.

    What lies within reach of a place is seen from the laser within one angle of it.
    """
    away = np.hypot(x - laser[0], y - laser[1])
    angle = np.arctan2(y - laser[1], x - laser[0])
    about = np.arcsin(reach / away) if away > reach else np.pi
    best, found = reach * reach, -1
    for turn in range(-1, 2):
        low = angle - about + 2.0 * np.pi * turn
        high = angle + about + 2.0 * np.pi * turn
        if high < -np.pi or low > np.pi:
            continue
        first, stop = begin, end
        while first < stop:  # the first bearing that is not below
            middle = (first + stop) // 2
            if bearings[middle] < low:
                first = middle + 1
            else:
                stop = middle
        for q in range(first, end):
            if bearings[q] > high:
                break
            dx, dy = x - points[q, 0], y - points[q, 1]
            off = dx * dx + dy * dy
            if off < best:
                is_line = normals[q, 0] != 0.0 or normals[q, 1] != 0.0
                same = fx * normals[q, 0] + fy * normals[q, 1]
                if is_line and (fx != 0.0 or fy != 0.0) and same < SAME_FACE:
                    continue
                best, found = off, q
    return found
