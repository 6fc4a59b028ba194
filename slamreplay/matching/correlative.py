"""Correlative scan matching in a window, and the climb from there to the top of the score.

The window search is Olson's (Real-time correlative scan matching, ICRA 2009) on one level: every
pose of a lattice is scored. The climb is Newton's method on the summed score itself, its first and
second derivatives taken by central differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from slamreplay.geometry import se2
from slamreplay.matching.field import ScoreField

_DAMPING_SIGMA_M = 0.1


@dataclass(frozen=True)
class Window:
    """Poses to try: plus and minus `reach` in steps, in metres and radians.

    `pull` is taken off the score at the window's edge, less towards its middle: it keeps a match
    that the points do not hold (along a corridor) where it was expected.
    """

    reach_m: float
    step_m: float
    reach_rad: float
    step_rad: float
    pull: float = 0.0


@dataclass(frozen=True, eq=False)
class Match:
    """A matched pose.

    Attributes:
        xyyaw: (3,) in the field's frame.
        score: mean over the points, 0 to 1.
        information: (3, 3) of x y yaw about the field's axes, from the curvature of the score.
    """

    xyyaw: se2.Array
    score: float
    information: se2.Array


def search_window(
    field: ScoreField, points: se2.Array, centre: se2.Array, window: Window
) -> tuple[se2.Array, float]:
    """The best pose (3,) of a window around `centre` and its mean score (without the pull)."""
    best = np.append(np.asarray(centre, dtype=np.float64), 0.0)
    shape = np.array(
        [window.reach_m, window.step_m, window.reach_rad, window.step_rad, window.pull]
    )
    points = np.ascontiguousarray(points)
    _search(field.values, *_frame(field), points, np.empty_like(points), shape, best)
    return best[:3], float(best[3])


def climb(field: ScoreField, points: se2.Array, start: se2.Array) -> Match:
    """The top of the score near `start` (within some centimetres), with its curvature."""
    pose = np.array(start, dtype=np.float64)
    if not len(points):
        return Match(pose, 0.0, np.zeros((3, 3)))
    # Damping goes with the number of points and their lever, so that a direction which no point
    # holds does not move.
    lever = 1.0 + float(np.mean(np.sum(points**2, axis=1)))
    scale = np.array([1.0, 1.0, lever]) * len(points) / _DAMPING_SIGMA_M**2
    information = np.zeros((3, 3))
    trial, gradient, damped = pose.copy(), np.zeros(3), np.zeros((3, 3))
    total = _climb(
        field.values,
        *_frame(field),
        np.ascontiguousarray(points),
        pose,
        scale,
        information,
        trial,
        gradient,
        damped,
    )
    return Match(pose, total / len(points), information)


def match(field: ScoreField, points: se2.Array, centre: se2.Array, window: Window) -> Match:
    """Window search, then the climb."""
    return climb(field, points, search_window(field, points, centre, window)[0])


def _frame(field: ScoreField) -> tuple[float, float, float]:
    return field.resolution_m, float(field.corner_xy[0]), float(field.corner_xy[1])


# The kernels work on scalars and on arrays they are handed: each array expression inside one would
# cost half a second of compilation.


@njit(cache=True)
def _search(values, resolution, x0, y0, points, turned, window, best):  # type: ignore[no-untyped-def]
    height, width = values.shape
    reach, step, reach_yaw, step_yaw, pull = window[0], window[1], window[2], window[3], window[4]
    n, n_yaw = int(np.ceil(reach / step - 1e-9)), int(np.ceil(reach_yaw / step_yaw - 1e-9))
    count = points.shape[0]
    x, y, heading = best[0], best[1], best[2]
    best_pulled = -np.inf
    for k in range(-n_yaw, n_yaw + 1):
        yaw = heading + k * step_yaw
        cos, sin = np.cos(yaw), np.sin(yaw)
        for p in range(count):
            turned[p, 0] = (x + cos * points[p, 0] - sin * points[p, 1] - x0) / resolution
            turned[p, 1] = (y + sin * points[p, 0] + cos * points[p, 1] - y0) / resolution
        turn = (k / n_yaw) ** 2 if n_yaw > 0 else 0.0
        for i in range(-n, n + 1):
            dy = i * step / resolution
            for j in range(-n, n + 1):
                dx = j * step / resolution
                total = np.float32(0.0)
                for p in range(count):
                    col, row = int(turned[p, 0] + dx), int(turned[p, 1] + dy)
                    if 0 <= row < height and 0 <= col < width:
                        total += values[row, col]
                score = total / max(count, 1)
                shift = (i * i + j * j) / (n * n) if n > 0 else 0.0
                pulled = score - pull * (turn + shift)
                if pulled > best_pulled:
                    best_pulled = pulled
                    best[0], best[1], best[2], best[3] = x + j * step, y + i * step, yaw, score


@njit(cache=True)
def _total(values, resolution, x0, y0, points, x, y, yaw):  # type: ignore[no-untyped-def]
    """Summed score of all points at a pose, bilinear between cell centres."""
    height, width = values.shape
    cos, sin = np.cos(yaw), np.sin(yaw)
    total = 0.0
    for p in range(points.shape[0]):
        u = (x + cos * points[p, 0] - sin * points[p, 1] - x0) / resolution - 0.5
        v = (y + sin * points[p, 0] + cos * points[p, 1] - y0) / resolution - 0.5
        if u >= 0.0 and v >= 0.0 and u < width - 1.0 and v < height - 1.0:
            col, row = int(u), int(v)
            fu, fv = u - col, v - row
            low = values[row, col] * (1.0 - fu) + values[row, col + 1] * fu
            high = values[row + 1, col] * (1.0 - fu) + values[row + 1, col + 1] * fu
            total += low * (1.0 - fv) + high * fv
    return total


@njit(cache=True)
def _derivatives(  # type: ignore[no-untyped-def]
    values, resolution, x0, y0, points, pose, top, trial, gradient, information
):
    """Central differences of the summed score: its gradient and minus its second derivatives."""
    for i in range(3):
        for j in range(i + 1):
            hi, hj = (0.01 if i == 2 else resolution), (0.01 if j == 2 else resolution)
            mixed = up = down = 0.0
            for corner in range(2 if i == j else 4):
                si, sj = 1.0 - 2.0 * (corner % 2), 1.0 - 2.0 * (corner // 2)
                trial[0], trial[1], trial[2] = pose[0], pose[1], pose[2]
                trial[i] += si * hi
                if i != j:
                    trial[j] += sj * hj
                total = _total(values, resolution, x0, y0, points, trial[0], trial[1], trial[2])
                mixed += si * sj * total
                up, down = (total, down) if si > 0.0 else (up, total)
            if i == j:
                gradient[i] = (up - down) / (2.0 * hi)
                information[i, i] = -(up - 2.0 * top + down) / (hi * hi)
            else:
                information[i, j] = information[j, i] = -mixed / (4.0 * hi * hj)


@njit(cache=True)
def _newton_step(A, b, step):  # type: ignore[no-untyped-def]
    """Write x of A x = b, for a symmetric 3x3 A, by cofactors, into `step`, kept short."""
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c01 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c02 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    c11 = A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0]
    c12 = A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1]
    c22 = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    det = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    inverse = 0.0 if det == 0.0 else 1.0 / det
    step[0] = min(max((c00 * b[0] + c01 * b[1] + c02 * b[2]) * inverse, -0.1), 0.1)
    step[1] = min(max((c01 * b[0] + c11 * b[1] + c12 * b[2]) * inverse, -0.1), 0.1)
    step[2] = min(max((c02 * b[0] + c12 * b[1] + c22 * b[2]) * inverse, -0.05), 0.05)


@njit(cache=True)
def _climb(  # type: ignore[no-untyped-def]
    values, resolution, x0, y0, points, pose, scale, information, step, gradient, damped
):
    """Move `pose` to the top of the score; leave its curvature in `information`."""
    top = _total(values, resolution, x0, y0, points, pose[0], pose[1], pose[2])
    damping = 1e-2
    for _ in range(12):
        _derivatives(values, resolution, x0, y0, points, pose, top, step, gradient, information)
        rise = 0.0
        for _attempt in range(4):
            for i in range(3):
                for j in range(3):
                    damped[i, j] = information[i, j]
                damped[i, i] = max(information[i, i], 0.0) + damping * scale[i]
            _newton_step(damped, gradient, step)
            x, y, yaw = pose[0] + step[0], pose[1] + step[1], pose[2] + step[2]
            total = _total(values, resolution, x0, y0, points, x, y, yaw)
            if total > top:
                rise = total - top
                pose[0], pose[1], pose[2], top = x, y, yaw, total
                damping = max(damping / 4.0, 1e-3)
                break
            damping *= 8.0
        if rise <= 1e-5 * points.shape[0]:
            break
    return top
