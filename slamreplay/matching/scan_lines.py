"""A scan as points with the direction of the surface at each: which way the wall there faces.

Beams come in order, so that who lies beside whom is known, and a line through the neighbours tells
more of a sparse scan than a search around each point would.
"""

from __future__ import annotations

import numpy as np
from numba import njit

#: Ends of neighbouring beams nearer than this are one point, their mean.
SPACING_M = 0.05
#: A line is fitted to what lies within this on either side; beams farther apart than the gap are
#: not on one surface.
SPAN_M, GAP_M = 0.15, 0.6
#: Points off their line by more than this (root of the mean square) make no line.
FLAT_M = 0.03
#: Surfaces seen at less than this sine of the angle of incidence are too often none at all but
#: beams that hit an edge and what is behind it.
GRAZING = 0.08
NEAREST_M, FARTHEST_M = 0.15, 50.0


@njit(cache=True, nogil=True)
def scan_lines(reach, is_hit, bearing, step, mount, during, points, normals):  # type: ignore[no-untyped-def]
    """Fill in the points of one scan and their normals about the base at its stamp; their number.

    Args:
        reach: (B,) ranges, m.
        is_hit: (B,) beams that hit something.
        bearing: of the first beam in the laser frame, rad.
        step: between beams, rad.
        mount: (3,) the laser on the robot.
        during: (3,) motion of the base from the first to the last beam, taken out linearly.
        points: (B, 2), written, m.
        normals: (B, 2), written: unit, towards the laser; 0 where there is no line.
    """
    width, count, members = reach.shape[0], np.int64(0), 0
    first_x = first_y = last_x = last_y = 0.0
    is_moving = during[0] != 0.0 or during[1] != 0.0 or during[2] != 0.0
    for b in range(width):
        if not is_hit[b] or not NEAREST_M <= reach[b] <= FARTHEST_M:
            continue
        angle = mount[2] + bearing + b * step
        x = mount[0] + reach[b] * np.cos(angle)
        y = mount[1] + reach[b] * np.sin(angle)
        if is_moving:
            part = b / max(width - 1, 1)
            cos, sin = np.cos(part * during[2]), np.sin(part * during[2])
            x, y = cos * x - sin * y + part * during[0], sin * x + cos * y + part * during[1]
        near = members > 0 and np.hypot(x - first_x, y - first_y) < SPACING_M
        if near and np.hypot(x - last_x, y - last_y) < SPACING_M:
            points[count - 1, 0] += (x - points[count - 1, 0]) / (members + 1)
            points[count - 1, 1] += (y - points[count - 1, 1]) / (members + 1)
            members += 1
        else:
            points[count, 0], points[count, 1] = x, y
            first_x, first_y, members = x, y, 1
            count += 1
        last_x, last_y = x, y
    for p in range(count):
        _line_at(points, count, p, mount, normals)
    return count


@njit(cache=True, nogil=True)
def _line_at(points, count, p, mount, normals):  # type: ignore[no-untyped-def]
    """The normal of the line through a point and its neighbours, where they make one."""
    normals[p, 0] = normals[p, 1] = 0.0
    low = high = p
    while low > 0 and low > p - 6:
        off = np.hypot(points[low - 1, 0] - points[low, 0], points[low - 1, 1] - points[low, 1])
        whole = np.hypot(points[low, 0] - points[p, 0], points[low, 1] - points[p, 1])
        if off > GAP_M or whole >= SPAN_M:
            break
        low -= 1
    while high < count - 1 and high < p + 6:
        off = np.hypot(points[high + 1, 0] - points[high, 0], points[high + 1, 1] - points[high, 1])
        whole = np.hypot(points[high, 0] - points[p, 0], points[high, 1] - points[p, 1])
        if off > GAP_M or whole >= SPAN_M:
            break
        high += 1
    n = high - low + 1
    if n < 3:
        return
    mx = my = 0.0
    for k in range(low, high + 1):
        mx += points[k, 0] / n
        my += points[k, 1] / n
    xx = xy = yy = 0.0
    for k in range(low, high + 1):
        dx, dy = points[k, 0] - mx, points[k, 1] - my
        xx += dx * dx / n
        xy += dx * dy / n
        yy += dy * dy / n
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    least, most = mean - half, mean + half
    if least > FLAT_M * FLAT_M or least > 0.1 * most:
        return
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    nx, ny = -np.sin(angle), np.cos(angle)
    to_x, to_y = mount[0] - points[p, 0], mount[1] - points[p, 1]
    facing = (nx * to_x + ny * to_y) / max(np.hypot(to_x, to_y), 1e-9)
    if abs(facing) < GRAZING:
        return
    sign = 1.0 if facing > 0.0 else -1.0
    normals[p, 0], normals[p, 1] = sign * nx, sign * ny
