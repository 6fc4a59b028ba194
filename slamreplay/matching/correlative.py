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
    best = _search(
        field.values,
        field.resolution_m,
        field.corner_xy[0],
        field.corner_xy[1],
        points,
        np.asarray(centre, dtype=np.float64),
        np.array([window.reach_m, window.step_m, window.reach_rad, window.step_rad, window.pull]),
    )
    return best[:3], float(best[3])


def climb(field: ScoreField, points: se2.Array, start: se2.Array) -> Match:
    """The top of the score near `start` (within some centimetres), with its curvature."""
    pose, score, information = _climb(
        field.values,
        field.resolution_m,
        field.corner_xy[0],
        field.corner_xy[1],
        points,
        np.asarray(start, dtype=np.float64),
    )
    return Match(pose, float(score), information)


def match(field: ScoreField, points: se2.Array, centre: se2.Array, window: Window) -> Match:
    """Window search, then the climb."""
    return climb(field, points, search_window(field, points, centre, window)[0])


@njit(cache=True)
def _search(values, resolution, x0, y0, points, centre, window):  # type: ignore[no-untyped-def]
    height, width = values.shape
    reach, step, reach_yaw, step_yaw, pull = window
    n, n_yaw = int(np.ceil(reach / step - 1e-9)), int(np.ceil(reach_yaw / step_yaw - 1e-9))
    count = points.shape[0]
    px, py = np.empty(count), np.empty(count)
    best = np.array([centre[0], centre[1], centre[2], 0.0])
    best_pulled = -np.inf
    if count == 0:
        return best
    for k in range(-n_yaw, n_yaw + 1):
        yaw = centre[2] + k * step_yaw
        cos, sin = np.cos(yaw), np.sin(yaw)
        for p in range(count):
            px[p] = (centre[0] + cos * points[p, 0] - sin * points[p, 1] - x0) / resolution
            py[p] = (centre[1] + sin * points[p, 0] + cos * points[p, 1] - y0) / resolution
        turn = (k * step_yaw / reach_yaw) ** 2 if reach_yaw > 0.0 else 0.0
        for i in range(-n, n + 1):
            dy = i * step / resolution
            for j in range(-n, n + 1):
                dx = j * step / resolution
                total = np.float32(0.0)
                for p in range(count):
                    col, row = int(px[p] + dx), int(py[p] + dy)
                    if 0 <= row < height and 0 <= col < width:
                        total += values[row, col]
                score = total / count
                shift = (i * i + j * j) / (n * n) if n > 0 else 0.0
                pulled = score - pull * (turn + shift)
                if pulled > best_pulled:
                    best_pulled = pulled
                    best[0] = centre[0] + j * step
                    best[1] = centre[1] + i * step
                    best[2] = yaw
                    best[3] = score
    return best


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
def _solve(A, b):  # type: ignore[no-untyped-def]
    """The x of A x = b for a symmetric 3x3 A, by cofactors; zero where A is singular."""
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c01 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c02 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    c11 = A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0]
    c12 = A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1]
    c22 = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    det = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    x = np.zeros(3)
    if det != 0.0:
        x[0] = (c00 * b[0] + c01 * b[1] + c02 * b[2]) / det
        x[1] = (c01 * b[0] + c11 * b[1] + c12 * b[2]) / det
        x[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / det
    return x


@njit(cache=True)
def _climb(values, resolution, x0, y0, points, start):  # type: ignore[no-untyped-def]  # noqa: C901
    count = points.shape[0]
    pose = start.copy()
    information = np.zeros((3, 3))
    if count == 0:
        return pose, 0.0, information
    h = np.array([resolution, resolution, 0.01])
    top = _total(values, resolution, x0, y0, points, pose[0], pose[1], pose[2])
    damping = 1e-2
    gradient = np.empty(3)
    for _ in range(12):
        for i in range(3):
            a, b = pose.copy(), pose.copy()
            a[i] += h[i]
            b[i] -= h[i]
            up = _total(values, resolution, x0, y0, points, a[0], a[1], a[2])
            down = _total(values, resolution, x0, y0, points, b[0], b[1], b[2])
            gradient[i] = (up - down) / (2.0 * h[i])
            information[i, i] = -(up - 2.0 * top + down) / (h[i] * h[i])
        for i in range(3):
            for j in range(i):
                mixed = 0.0
                for si in (-1, 1):
                    for sj in (-1, 1):
                        a = pose.copy()
                        a[i] += si * h[i]
                        a[j] += sj * h[j]
                        mixed += (
                            si * sj * _total(values, resolution, x0, y0, points, a[0], a[1], a[2])
                        )
                information[i, j] = information[j, i] = -mixed / (4.0 * h[i] * h[j])
        # Damping in proportion to the number of points, so that a direction which no point holds
        # does not move; its unit is that of the curvature: points per sigma^2.
        lever = 1.0 + np.mean(points[:, 0] ** 2 + points[:, 1] ** 2)
        scale = np.array([1.0, 1.0, lever]) * count / (0.1 * 0.1)
        moved = False
        for _try in range(4):
            A = information.copy()
            for i in range(3):
                A[i, i] = max(A[i, i], 0.0) + damping * scale[i]
            step = _solve(A, gradient)
            step[:2] = np.minimum(np.maximum(step[:2], -0.1), 0.1)
            step[2] = min(max(step[2], -0.05), 0.05)
            trial = pose + step
            total = _total(values, resolution, x0, y0, points, trial[0], trial[1], trial[2])
            if total > top:
                moved = total - top > 1e-5 * count
                pose, top = trial, total
                damping = max(damping / 4.0, 1e-3)
                break
            damping *= 8.0
        if not moved:
            break
    return pose, top / count, information
