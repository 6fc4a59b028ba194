"""The loops under correlative matching, compiled.

The kernels work on scalars and on arrays they are handed: each array expression inside one would
cost half a second of compilation. They do without Python's lock, so that threads may share jobs.
They stand in one file because numba compiles a cached kernel again when its own file changes, and
not when that of a kernel it calls does.
"""

from __future__ import annotations

import numpy as np
from numba import njit

#: A point damps a step as much as a measurement of this standard deviation would.
DAMPING_SIGMA_M = 0.1


@njit(cache=True, nogil=True)
def match_jobs(field, points, bounds, windows, first, stop, out, scratch):  # type: ignore[no-untyped-def]
    """Match the jobs from `first` to before `stop`: search each one's window, then climb.

    Args:
        field: values (H, W), resolution, x and y of the corner.
        points: (P, 2) of all clouds.
        bounds: (N, 2) first point of each job's cloud and stop.
        windows: (N, 5) reach, step, reach and step in yaw, pull; a step of 0: climb only.
        first: of the jobs.
        stop: of the jobs.
        out: poses (N, 3), moved in place, scores (N,) and information (N, 3, 3).
        scratch: arrays that are this thread's alone.
    """
    values, resolution, x0, y0 = field
    poses, scores, information = out
    totals, cells, best, sums, damped, small = scratch
    for n in range(first, stop):
        cloud = points[bounds[n, 0] : bounds[n, 1]]
        if cloud.shape[0] == 0:
            continue
        if windows[n, 1] > 0.0:
            for i in range(3):
                best[i] = poses[n, i]
            search(values, resolution, x0, y0, cloud, windows[n], best, totals, cells)
            for i in range(3):
                poses[n, i] = best[i]
        top = climb_up(
            values, resolution, x0, y0, cloud, poses[n], information[n], sums, damped, small
        )
        scores[n] = top / cloud.shape[0]


@njit(cache=True, nogil=True)
def search(values, resolution, x0, y0, points, window, best, totals, cells):  # type: ignore[no-untyped-def]
    """Leave the best pose of the window around `best`, and its mean score, in `best`."""
    reach, step, reach_yaw, step_yaw, pull = window[0], window[1], window[2], window[3], window[4]
    n, n_yaw = int(np.ceil(reach / step - 1e-9)), int(np.ceil(reach_yaw / step_yaw - 1e-9))
    count = points.shape[0]
    x, y, heading = best[0], best[1], best[2]
    best_pulled = -np.inf
    for k in range(-n_yaw, n_yaw + 1):
        yaw = heading + k * step_yaw
        _window_totals(values, (resolution, x0, y0, x, y, yaw), points, n, step, totals, cells)
        turn = (k / n_yaw) ** 2 if n_yaw > 0 else 0.0
        for i in range(-n, n + 1):
            for j in range(-n, n + 1):
                score = totals[i + n, j + n] / max(count, 1)
                shift = (i * i + j * j) / (n * n) if n > 0 else 0.0
                pulled = score - pull * (turn + shift)
                if pulled > best_pulled:
                    best_pulled = pulled
                    best[0], best[1], best[2], best[3] = x + j * step, y + i * step, yaw, score


@njit(cache=True, nogil=True)
def _window_totals(values, frame, points, n, step, totals, cells):  # type: ignore[no-untyped-def]
    """Summed scores at one heading, at places up to n steps to each side.

    The cell of a point is found once per row and once per column of the window, not once per place.
    """
    height, width = values.shape
    resolution, x0, y0, x, y, yaw = frame
    side = 2 * n + 1
    cos, sin = np.cos(yaw), np.sin(yaw)
    for i in range(side):
        for j in range(side):
            totals[i, j] = np.float32(0.0)
    for p in range(points.shape[0]):
        u = (x + cos * points[p, 0] - sin * points[p, 1] - x0) / resolution
        v = (y + sin * points[p, 0] + cos * points[p, 1] - y0) / resolution
        for i in range(side):
            shift = (i - n) * step / resolution
            cells[0, i], cells[1, i] = int(u + shift), int(v + shift)
        whole = cells[0, 0] >= 0 and cells[0, side - 1] < width
        for i in range(side):
            row = cells[1, i]
            if not 0 <= row < height:
                continue
            for j in range(side):
                if whole or 0 <= cells[0, j] < width:
                    totals[i, j] += values[row, cells[0, j]]


@njit(cache=True, nogil=True)
def total_at(values, resolution, x0, y0, points, x, y, yaw):  # type: ignore[no-untyped-def]
    """Summed score of all points at a pose, bilinear between cell centres."""
    cos, sin = np.cos(yaw) / resolution, np.sin(yaw) / resolution
    x, y = (x - x0) / resolution - 0.5, (y - y0) / resolution - 0.5
    total = 0.0
    for p in range(points.shape[0]):
        u = x + cos * points[p, 0] - sin * points[p, 1]
        v = y + sin * points[p, 0] + cos * points[p, 1]
        total += _between_cells(values, u, v)
    return total


@njit(cache=True, nogil=True)
def _between_cells(values, u, v):  # type: ignore[no-untyped-def]
    height, width = values.shape
    if not (u >= 0.0 and v >= 0.0 and u < width - 1.0 and v < height - 1.0):
        return 0.0
    col, row = int(u), int(v)
    fu, fv = u - col, v - row
    low = values[row, col] * (1.0 - fu) + values[row, col + 1] * fu
    high = values[row + 1, col] * (1.0 - fu) + values[row + 1, col + 1] * fu
    return low * (1.0 - fv) + high * fv


@njit(cache=True, nogil=True)
def _totals_around(values, resolution, x0, y0, points, pose, yaw, sums):  # type: ignore[no-untyped-def]
    """Summed scores at a heading and at places one cell apart: `sums` (3, 3), rows along y.

    Places one cell apart weigh the same sixteen cells about a point, with the same weights.
    """
    height, width = values.shape
    cos, sin = np.cos(yaw) / resolution, np.sin(yaw) / resolution
    x, y = (pose[0] - x0) / resolution - 0.5, (pose[1] - y0) / resolution - 0.5
    s00 = s01 = s02 = s10 = s11 = s12 = s20 = s21 = s22 = 0.0
    for p in range(points.shape[0]):
        u = x + cos * points[p, 0] - sin * points[p, 1]
        v = y + sin * points[p, 0] + cos * points[p, 1]
        if u >= 1.0 and v >= 1.0 and u < width - 2.0 and v < height - 2.0:
            col, row = int(u), int(v)
            fu, fv = u - col, v - row
            a0 = a1 = a2 = 0.0
            for r in range(4):
                line = values[row - 1 + r]
                first, second = np.float64(line[col - 1]), np.float64(line[col])
                third, fourth = np.float64(line[col + 1]), np.float64(line[col + 2])
                b0 = first + (second - first) * fu
                b1 = second + (third - second) * fu
                b2 = third + (fourth - third) * fu
                if r == 1:
                    s00 += a0 + (b0 - a0) * fv
                    s01 += a1 + (b1 - a1) * fv
                    s02 += a2 + (b2 - a2) * fv
                elif r == 2:
                    s10 += a0 + (b0 - a0) * fv
                    s11 += a1 + (b1 - a1) * fv
                    s12 += a2 + (b2 - a2) * fv
                elif r == 3:
                    s20 += a0 + (b0 - a0) * fv
                    s21 += a1 + (b1 - a1) * fv
                    s22 += a2 + (b2 - a2) * fv
                a0, a1, a2 = b0, b1, b2
        elif u > -1.0 and v > -1.0 and u < width and v < height:
            s00 += _between_cells(values, u - 1.0, v - 1.0)
            s01 += _between_cells(values, u, v - 1.0)
            s02 += _between_cells(values, u + 1.0, v - 1.0)
            s10 += _between_cells(values, u - 1.0, v)
            s11 += _between_cells(values, u, v)
            s12 += _between_cells(values, u + 1.0, v)
            s20 += _between_cells(values, u - 1.0, v + 1.0)
            s21 += _between_cells(values, u, v + 1.0)
            s22 += _between_cells(values, u + 1.0, v + 1.0)
    sums[0, 0], sums[0, 1], sums[0, 2] = s00, s01, s02
    sums[1, 0], sums[1, 1], sums[1, 2] = s10, s11, s12
    sums[2, 0], sums[2, 1], sums[2, 2] = s20, s21, s22


@njit(cache=True, nogil=True)
def _derivatives(  # type: ignore[no-untyped-def]
    values, resolution, x0, y0, points, pose, sums, gradient, information
):
    """Central differences of the summed score: its gradient and minus its second derivatives."""
    # One cell, and the turn that moves a point 5 m away by one cell of 0.05 m.
    h, turn = resolution, 0.01
    for k in range(3):
        yaw = pose[2] + (k - 1) * turn
        _totals_around(values, resolution, x0, y0, points, pose, yaw, sums[k])
    less, here, more = sums[0], sums[1], sums[2]
    top = here[1, 1]
    gradient[0] = (here[1, 2] - here[1, 0]) / (2.0 * h)
    gradient[1] = (here[2, 1] - here[0, 1]) / (2.0 * h)
    gradient[2] = (more[1, 1] - less[1, 1]) / (2.0 * turn)
    information[0, 0] = -(here[1, 2] - 2.0 * top + here[1, 0]) / (h * h)
    information[1, 1] = -(here[2, 1] - 2.0 * top + here[0, 1]) / (h * h)
    information[2, 2] = -(more[1, 1] - 2.0 * top + less[1, 1]) / (turn * turn)
    xy = here[2, 2] - here[2, 0] - here[0, 2] + here[0, 0]
    x_yaw = more[1, 2] - more[1, 0] - less[1, 2] + less[1, 0]
    y_yaw = more[2, 1] - more[0, 1] - less[2, 1] + less[0, 1]
    information[0, 1] = information[1, 0] = -xy / (4.0 * h * h)
    information[0, 2] = information[2, 0] = -x_yaw / (4.0 * h * turn)
    information[1, 2] = information[2, 1] = -y_yaw / (4.0 * h * turn)


@njit(cache=True, nogil=True)
def _newton_step(A, b, step):  # type: ignore[no-untyped-def]
    """Write x of A x = b, for a symmetric 3x3 A, by cofactors, into `step`.

    A step is kept within 0.1 m and 0.05 rad: the curvature that made it was taken over one cell.
    """
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


@njit(cache=True, nogil=True)
def climb_up(values, resolution, x0, y0, points, pose, information, sums, damped, small):  # type: ignore[no-untyped-def]
    """Move `pose` to the top of the score; leave its curvature in `information`.

    Newton's method, damped as Levenberg (1944) does: more after a step that did not climb, less
    after one that did.

    Args:
        values: (H, W) of the field.
        resolution: edge of a cell, m.
        x0: of the field's corner, m.
        y0: of the field's corner, m.
        points: (P, 2) of the cloud, m.
        pose: (3,), moved in place.
        information: (3, 3), written.
        sums: (3, 3, 3) scratch.
        damped: (3, 3) scratch.
        small: (3, 3) scratch.

    Returns:
        The summed score at the top.
    """
    count = points.shape[0]
    gradient, step, scale = small[0], small[1], small[2]
    # Damping goes with the number of points and their lever, so that a direction which no point
    # holds does not move.
    lever = 0.0
    for p in range(count):
        lever += points[p, 0] * points[p, 0] + points[p, 1] * points[p, 1]
    scale[0] = scale[1] = count / DAMPING_SIGMA_M**2
    scale[2] = (1.0 + lever / count) * scale[0]
    top = total_at(values, resolution, x0, y0, points, pose[0], pose[1], pose[2])
    damping = 1e-2
    for _ in range(12):
        _derivatives(values, resolution, x0, y0, points, pose, sums, gradient, information)
        rise = 0.0
        for _attempt in range(4):
            for i in range(3):
                for j in range(3):
                    damped[i, j] = information[i, j]
                damped[i, i] = max(information[i, i], 0.0) + damping * scale[i]
            _newton_step(damped, gradient, step)
            x, y, yaw = pose[0] + step[0], pose[1] + step[1], pose[2] + step[2]
            total = total_at(values, resolution, x0, y0, points, x, y, yaw)
            if total > top:
                rise = total - top
                pose[0], pose[1], pose[2], top = x, y, yaw, total
                damping = max(damping / 4.0, 1e-3)
                break
            damping *= 8.0
        if rise <= 1e-5 * count:
            break
    return top
