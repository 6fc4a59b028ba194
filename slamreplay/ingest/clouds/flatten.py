"""One scan of each cloud: the nearest surface in the height band, beam by beam, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.clouds.setting import Setting
from slamreplay.ingest.clouds.sweep import SweepMotion

#: A surface is as thick as this: noise, and the slant of a wall within one beam.
_THICK_M = 0.15
#: What a beam without a return can prove free at the most, m: nobody believes more of one.
FREE_M = 30.0
#: Beyond the farthest return by so much, so that no range looks like a driver's code for none.
_BEYOND_M = 0.01
#: A beam's range is told where its middle meets a wall through neighbours this far to both sides
#: that lie in line with it: m, m, and a metre's share of the range.
_SIDE_M, _OFF_LINE_M, _OFF_LINE = 0.1, 0.03, 0.003


def flattened(
    clouds: Clouds, setting: Setting, T_base_sensor: Array, motion: SweepMotion
) -> tuple[NDArray[np.float32], NDArray[np.float64], int]:
    """Scans of N clouds about the level frame of a setting.

    Args:
        clouds: of the setting's sensor.
        setting: what is known of it.
        T_base_sensor: (N, 4, 4) where it sat.
        motion: of the base within each sweep.

    Returns:
        (N, B) ranges m, with +inf and NaN as the package says; (N,) range_max m; and how many
        returns in the band lay beyond the scan's field of view.
    """
    n, band = len(clouds), setting.band
    ranges = np.full((n, setting.beams), np.nan, dtype=np.float32)
    reach = np.full(n, FREE_M)
    rays = np.empty((3, 0), dtype=np.float32) if setting.rays is None else setting.rays
    largest = int(np.diff(clouds.offsets).max(initial=0))
    outside = _flatten(
        clouds.xyz,
        clouds.offsets,
        np.ascontiguousarray(T_base_sensor[:, :3, :]),
        motion.late_s,
        motion.from_s,
        motion.step_s,
        motion.xyyaw,
        rays,
        setting.level_xy,
        setting.floor,
        np.array([band.low_m, band.high_m, band.rise, band.rises_to_m]),
        setting.sensor_height_m,
        np.array([setting.range_min_m, setting.body_m]),
        (setting.angle_min, setting.increment, setting.beams, setting.turn),
        setting.support,
        largest,
        ranges,
        reach,
    )
    return ranges, reach, int(outside)


@njit(cache=True, nogil=True)
def _flatten(  # type: ignore[no-untyped-def]  # noqa: C901
    xyz, offsets, mounts, late, late_from, late_step, motion, rays, level, floor, band, height,
    near, grid, support, largest, ranges, reach,
):  # fmt: skip
    first_angle, increment, beams, turn = grid
    beam_of, at_x, at_y = np.empty(largest, np.int64), np.empty(largest), np.empty(largest)
    closest = np.empty((beams, support))
    passed, sum_x, sum_y, count = np.empty(beams), np.empty(beams), np.empty(beams), np.empty(beams)
    is_late, knots, outside = len(late) > 0, motion.shape[1] - 1, 0
    for c in range(len(offsets) - 1):
        begin, end = offsets[c], offsets[c + 1]
        has_rays = rays.shape[1] > 0 and rays.shape[1] == end - begin
        m = mounts[c]
        closest[:], passed[:], sum_x[:], sum_y[:], count[:] = np.inf, 0.0, 0.0, 0.0, 0.0
        kept = 0
        for i in range(begin, end):
            x, y, z = float(xyz[0, i]), float(xyz[1, i]), float(xyz[2, i])
            is_return = x == x
            if not is_return:
                if not has_rays:
                    continue
                x, y, z = (float(rays[0, i - begin]), float(rays[1, i - begin]),
                           float(rays[2, i - begin]))  # fmt: skip
                if x != x:
                    continue
            bx = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
            by = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
            bz = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
            across = np.sqrt(bx * bx + by * by)
            slope = (bz - floor[1] * bx - floor[2] * by) / max(across, 1e-9)
            sx, sy = m[0, 3], m[1, 3]
            ox, oy, turned = 0.0, 0.0, 0.0
            if is_late:
                after = late[i]
                if after == after:
                    part = (after - late_from[c]) / late_step[c]
                    knot = min(max(int(part), 0), knots - 1)
                    part -= knot
                    ox = motion[c, knot, 0] + part * (motion[c, knot + 1, 0] - motion[c, knot, 0])
                    oy = motion[c, knot, 1] + part * (motion[c, knot + 1, 1] - motion[c, knot, 1])
                    turned = motion[c, knot, 2]
                    turned += part * (motion[c, knot + 1, 2] - turned)
                elif not is_return:
                    continue  # nobody knows where this ray went
            cos, sin = 1.0, 0.0
            if turned != 0.0:
                cos, sin = np.cos(turned), np.sin(turned)
            if not is_return:
                k = _beam(cos * bx - sin * by, sin * bx + cos * by, first_angle, increment, turn)
                if k < beams:
                    passed[k] = max(passed[k], _way(slope, height, band))
                continue
            bx, by, bz = bx + sx, by + sy, bz + m[2, 3]
            if across < near[0] or bx * bx + by * by < near[1] * near[1]:
                continue  # the robot itself
            above = bz - floor[0] - floor[1] * bx - floor[2] * by
            px, py = ox + cos * bx - sin * by - level[0], oy + sin * bx + cos * by - level[1]
            k = _beam(px, py, first_angle, increment, turn)
            low = min(band[0] + band[2] * across, band[3])
            if above < low or above > band[1]:
                if k < beams:
                    passed[k] = max(passed[k], min(_way(slope, height, band), across))
                continue
            if k >= beams:
                outside += 1
                continue
            beam_of[kept], at_x[kept], at_y[kept] = k, px, py
            kept += 1
            distance = np.sqrt(px * px + py * py)
            for j in range(support):
                if distance < closest[k, j]:
                    closest[k, j], distance = distance, closest[k, j]
        for i in range(kept):
            k = beam_of[i]
            distance = np.sqrt(at_x[i] * at_x[i] + at_y[i] * at_y[i])
            if abs(distance - closest[k, support - 1]) <= _THICK_M:
                sum_x[k] += at_x[i]
                sum_y[k] += at_y[i]
                count[k] += 1.0
        farthest = 0.0
        for k in range(beams):
            if count[k] > 0.0:
                sum_x[k], sum_y[k] = sum_x[k] / count[k], sum_y[k] / count[k]
        for k in range(beams):
            if count[k] > 0.0:
                r = _at_middle(k, sum_x, sum_y, count, first_angle, increment, beams, turn)
                ranges[c, k] = r
                farthest = max(farthest, r)
        if farthest > 0.0:
            reach[c] = farthest + _BEYOND_M
            for k in range(beams):
                if closest[k, 0] == np.inf and passed[k] >= min(reach[c], FREE_M):
                    ranges[c, k] = np.inf
    return outside


@njit(cache=True, nogil=True, inline="always")
def _beam(x, y, first_angle, increment, turn):  # type: ignore[no-untyped-def]
    """Number of the beam that a point lies in, counted over a whole turn."""
    angle = (np.arctan2(y, x) - first_angle) % (2.0 * np.pi)
    return int(np.rint(angle / increment)) % turn


@njit(cache=True, nogil=True, inline="always")
def _way(slope, height, band):  # type: ignore[no-untyped-def]
    """How far a ray from the sensor stays inside the band, in metres along the floor."""
    if not band[0] < height < band[1]:
        return 0.0  # also where the sensor's height is not known
    if slope > 0.0:
        return (band[1] - height) / slope
    rising = (height - band[0]) / max(band[2] - slope, 1e-9)
    level = (height - band[3]) / max(-slope, 1e-9)
    return max(rising, level)


@njit(cache=True, nogil=True)
def _at_middle(k, xs, ys, count, first_angle, increment, beams, turn):  # type: ignore[no-untyped-def]
    """Range at which the middle of a beam meets what its points lie on."""
    x, y = xs[k], ys[k]
    r = np.sqrt(x * x + y * y)
    away = min(max(int(np.ceil(_SIDE_M / (max(r, 0.1) * increment))), 1), 12)
    left, right = k - away, k + away
    if beams == turn:
        left, right = left % beams, right % beams
    if left < 0 or right >= beams or count[left] == 0.0 or count[right] == 0.0:
        return r
    ax, ay, vx, vy = xs[left], ys[left], xs[right] - xs[left], ys[right] - ys[left]
    length = np.sqrt(vx * vx + vy * vy)
    if length == 0.0:
        return r
    vx, vy = vx / length, vy / length
    along = (x - ax) * vx + (y - ay) * vy
    off = abs((x - ax) * vy - (y - ay) * vx)
    if off > _OFF_LINE_M + _OFF_LINE * r or along <= 0.0 or along >= length:
        return r
    ux, uy = np.cos(first_angle + k * increment), np.sin(first_angle + k * increment)
    facing = ux * vy - uy * vx
    if abs(facing) < 0.05:
        return r
    met = (x * vy - y * vx) / facing
    return met if abs(met - r) < 0.5 * length else r
