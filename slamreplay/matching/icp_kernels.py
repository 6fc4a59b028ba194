"""The loops under point-to-line ICP, compiled.

They stand in one file because numba compiles a cached kernel again when its own file changes, and
not when that of a kernel it calls does.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def register(target, count, frame, points, pose, limits, partner, out, room, tally):  # type: ignore[no-untyped-def]  # noqa: C901
    """Move `pose` to the best fit; write information, directions and what else is told."""
    noise, most, lever = limits[1], int(limits[2]), limits[5]
    width, stride = limits[0] / 2.0, int(limits[3])
    if points.shape[0] < 100:
        stride = 1
    for step in range(most):
        rms = sum_up(
            target, frame, points, pose, limits[0], width, stride, lever, partner, out, tally
        )
        axes(out, room, limits[4])
        moved = move(out, pose, lever, tally[4])
        narrow = max(min(width, 2.5 * rms), 2.5 * noise)
        settled = narrow > 0.8 * width
        width = narrow
        tally[2] = step + 1
        if moved < (2e-3 if stride > 1 else 1e-5) and settled:
            if stride == 1:
                tally[3] = 1.0
                break
            stride = 1
    every = np.int64(1)  # a plain 1 would have the sums compiled once more, for it alone
    # Of where the pose is: weights by a width that goes with the fit, whatever it was before.
    for _ in range(20):
        rms = sum_up(
            target, frame, points, pose, limits[0], width, every, lever, partner, out, tally
        )
        narrow = max(min(width, 2.5 * rms), 2.5 * noise)
        if narrow > 0.8 * width:
            break
        width = narrow
    # A line of n points is off by the noise of their mean, and k pairs with it are so together:
    # each tells 1 / (1 + k / n) of what it would tell of a line that is known.
    trust = target[5]
    for q in range(trust.shape[0]):
        trust[q] = 0.0
    for p in range(points.shape[0]):
        if partner[p] >= 0:
            trust[partner[p]] += 1.0
    for q in range(trust.shape[0]):
        trust[q] = 1.0 / (1.0 + trust[q] / count[q])
    sum_up(target, frame, points, pose, limits[0], width, every, lever, partner, out, tally)
    axes(out, room, limits[4])
    tally[1] = rms
    variance = max(tally[1], noise) ** 2
    # Back from the scaled yaw; directions that are not observed lose what noise gave them.
    for i in range(3):
        for j in range(3):
            out[0, i, j] = 0.0
            for k in range(3):
                if out[3, 2, k] > 0.0:
                    share = out[3, 1, k] * tally[4]
                    out[0, i, j] += share * out[2, k, i] * out[2, k, j] / variance
            out[0, i, j] *= (lever if i == 2 else 1.0) * (lever if j == 2 else 1.0)


@njit(cache=True, nogil=True)
def sum_up(  # type: ignore[no-untyped-def]
    target, frame, points, pose, reach, width, stride, lever, partner, out, tally
):
    """Sum the normal equations over every `stride`-th point; yaw is scaled by the lever.

    Writes information, what noise feigns of it, and the gradient, all divided by the sum of the
    weights, which goes to `tally[4]`; the share of inliers goes to `tally[0]`.

    Returns:
        The inliers' root mean square distance from their lines.
    """
    cloud, normals, offsets, variance, index, trust = target
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    total = squares = 0.0
    inliers = near = 0
    h00 = h01 = h02 = h11 = h12 = h22 = 0.0
    b00 = b01 = b02 = b11 = b12 = b22 = 0.0
    g0 = g1 = g2 = 0.0
    for p in range(0, points.shape[0], stride):
        u = cos * points[p, 0] - sin * points[p, 1]
        v = sin * points[p, 0] + cos * points[p, 1]
        x, y = pose[0] + u, pose[1] + v
        q = nearest(cloud, index, frame, x, y, reach, partner[p])
        partner[p] = q
        near += 1
        if q < 0:
            continue
        nx, ny = normals[q, 0], normals[q, 1]
        off = nx * (x - cloud[q, 0]) + ny * (y - cloud[q, 1]) + offsets[q]
        ratio = off / width
        weight = np.exp(-0.5 * ratio * ratio)
        if weight > 0.5:
            inliers += 1
            squares += off * off
        weight *= trust[q]
        turn, slide = (ny * u - nx * v) / lever, (nx * u + ny * v) / lever
        total += weight
        g0 += weight * off * nx
        g1 += weight * off * ny
        g2 += weight * off * turn
        h00 += weight * nx * nx
        h01 += weight * nx * ny
        h02 += weight * nx * turn
        h11 += weight * ny * ny
        h12 += weight * ny * turn
        h22 += weight * turn * turn
        # A normal that is a little off has a part along its line.
        weight *= variance[q]
        b00 += weight * ny * ny
        b01 -= weight * ny * nx
        b02 -= weight * ny * slide
        b11 += weight * nx * nx
        b12 += weight * nx * slide
        b22 += weight * slide * slide
    scale = 1.0 / total if total > 0.0 else 0.0
    H, B = out[0], out[1]
    H[0, 0], H[1, 1], H[2, 2] = h00 * scale, h11 * scale, h22 * scale
    H[0, 1] = H[1, 0] = h01 * scale
    H[0, 2] = H[2, 0] = h02 * scale
    H[1, 2] = H[2, 1] = h12 * scale
    B[0, 0], B[1, 1], B[2, 2] = b00 * scale, b11 * scale, b22 * scale
    B[0, 1] = B[1, 0] = b01 * scale
    B[0, 2] = B[2, 0] = b02 * scale
    B[1, 2] = B[2, 1] = b12 * scale
    out[3, 0, 0], out[3, 0, 1], out[3, 0, 2] = g0 * scale, g1 * scale, g2 * scale
    tally[0], tally[4] = inliers / max(near, 1), total
    return np.sqrt(squares / inliers) if inliers > 0 else width


@njit(cache=True, nogil=True)
def nearest(cloud, index, frame, x, y, reach, before):  # type: ignore[no-untyped-def]
    """The nearest of the target's points within reach, or -1; quickest from where it was `before`.

    Squares of cells about (x, y) are looked through, one ring after another, until all that is
    left lies beyond the nearest found.
    """
    cell, x0, y0 = frame
    rows, columns = index.shape
    u, v = (x - x0) / cell, (y - y0) / cell
    col, row = int(np.floor(u)), int(np.floor(v))
    best, found = reach * reach, np.int64(-1)
    if before >= 0:
        dx, dy = cloud[before, 0] - x, cloud[before, 1] - y
        if dx * dx + dy * dy <= best:
            best, found = dx * dx + dy * dy, before
    # From the point to the nearest edge of its cell: rings begin so much farther than their number.
    edge = min(u - col, col + 1.0 - u, v - row, row + 1.0 - v)
    ring = 0
    while ring == 0 or ((ring - 1 + edge) * cell) ** 2 < best:
        left, right = max(col - ring, 0), min(col + ring, columns - 1)
        for r in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            stride = 1 if r == row - ring or r == row + ring else max(2 * ring, 1)
            c = left if stride == 1 or left == col - ring else col + ring
            while 0 <= c <= right:
                q = np.int64(index[r, c])
                if q >= 0:
                    dx, dy = cloud[q, 0] - x, cloud[q, 1] - y
                    if dx * dx + dy * dy < best:
                        best, found = dx * dx + dy * dy, q
                c += stride
        ring += 1
    return found


@njit(cache=True, nogil=True)
def axes(out, room, least):  # type: ignore[no-untyped-def]  # noqa: C901
    """Eigenvectors of the information, from the least value on, and which are observed.

    Jacobi's rotations: a routine for any size would cost seconds of compilation.
    """
    A, V = room, out[2]
    for i in range(3):
        for j in range(3):
            A[i, j] = out[0, i, j]
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(12):
        for i in range(2):
            for j in range(i + 1, 3):
                if abs(A[i, j]) < 1e-18:
                    continue
                theta = (A[j, j] - A[i, i]) / (2.0 * A[i, j])
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                t = -t if theta < 0.0 else t
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    a, b = A[k, i], A[k, j]
                    A[k, i], A[k, j] = c * a - s * b, s * a + c * b
                for k in range(3):
                    a, b = A[i, k], A[j, k]
                    A[i, k], A[j, k] = c * a - s * b, s * a + c * b
                    a, b = V[i, k], V[j, k]
                    V[i, k], V[j, k] = c * a - s * b, s * a + c * b
    for i in range(2):
        for j in range(2 - i):
            if A[j, j] > A[j + 1, j + 1]:
                A[j, j], A[j + 1, j + 1] = A[j + 1, j + 1], A[j, j]
                for k in range(3):
                    V[j, k], V[j + 1, k] = V[j + 1, k], V[j, k]
    for i in range(3):
        feigned = 0.0
        for j in range(3):
            for k in range(3):
                feigned += V[i, j] * out[1, j, k] * V[i, k]
        share = max(A[i, i], 0.0)
        out[3, 1, i] = share
        out[3, 2, i] = 1.0 if share > 3.0 * feigned + least else 0.0


@njit(cache=True, nogil=True)
def move(out, pose, lever, total):  # type: ignore[no-untyped-def]
    """One step of Gauss and Newton along the observed directions; how far, in m."""
    moved = 0.0
    if total <= 0.0:
        return moved
    for i in range(3):
        if out[3, 2, i] > 0.0:
            along = 0.0
            for k in range(3):
                along -= out[2, i, k] * out[3, 0, k]
            along /= out[3, 1, i]
            along = min(max(along, -0.5), 0.5)
            pose[0] += along * out[2, i, 0]
            pose[1] += along * out[2, i, 1]
            pose[2] += along * out[2, i, 2] / lever
            moved += along * along
    return np.sqrt(moved)
