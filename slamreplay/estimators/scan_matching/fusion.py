"""Odometry and match weighed against each other, and what odometry misses learned from it.

All covariances here are of x y yaw about the axes of the local frame, of a pose against the last
node, which lies in the map itself.
"""

from __future__ import annotations

import numpy as np
from numba import njit

#: What odometry misses of a step at the least: m, rad. It also rounds.
LEAST_M, LEAST_RAD = 0.002, 0.001
#: A match that holds nothing at all still holds this: m, rad.
ANYWHERE_M, ANYWHERE_RAD = 1.0, 1.0
#: So many scans weigh as much as what is assumed of odometry at first, and at the most.
FIRST_SCANS, MOST_SCANS = 20.0, 300.0
#: The noise learned stays within these factors of what is assumed, as variances.
LEAST_FACTOR, MOST_FACTOR = 0.01, 400.0
#: What is assumed is blunt, for what odometry misses is not white: these factors are likely.
LIKELY_FACTOR, LIKELY_FACTOR_YAW = 0.4, 0.04
#: Squares of what odometry missed count up to so many times what was expected.
MOST_SQUARES = 25.0


@njit(cache=True, nogil=True)
def predict(pose, cov, step, per_way, learned, least, prior, noise, expected, held):  # type: ignore[no-untyped-def]
    """Carry a pose and its covariance over a step; write the prior and its information, too.

    Args:
        pose: (3,) of the scan before.
        cov: (3, 3) of it.
        step: (3,) motion in the axes of the base there.
        per_way: (4,) standard deviation of position per root of m and rad, and of heading.
        learned: (3,) factors of the variances of position and heading, scans they come from.
        least: (2,) m and rad, what any step misses.
        prior: (3,) written.
        noise: (4,) variances of the step in position and heading, written: as a prior has them,
            never less than assumed, for what odometry misses is not white; and as learned.
        expected: (3, 3) covariance of the prior, written.
        held: (3, 3) its inverse, written.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = cos * step[0] - sin * step[1], sin * step[0] + cos * step[1]
    prior[0], prior[1] = pose[0] + dx, pose[1] + dy
    prior[2] = (pose[2] + step[2] + np.pi) % (2.0 * np.pi) - np.pi
    way, turn = np.hypot(dx, dy), abs(step[2])
    assumed = per_way[0] ** 2 * way + per_way[1] ** 2 * turn
    assumed_yaw = per_way[2] ** 2 * way + per_way[3] ** 2 * turn
    noise[0] = max(learned[0], 1.0) * assumed + least[0] ** 2
    noise[1] = max(learned[1], 1.0) * assumed_yaw + least[1] ** 2
    noise[2] = learned[0] * assumed + least[0] ** 2
    noise[3] = learned[1] * assumed_yaw + least[1] ** 2
    _swung(cov, dx, dy, expected)
    expected[0, 0] += noise[0]
    expected[1, 1] += noise[0]
    expected[2, 2] += noise[1]
    inverse(expected, held)


@njit(cache=True, nogil=True)
def late(prior, step, part, least, out):  # type: ignore[no-untyped-def]
    """Covariance (3, 3) of a pose whose stamp is off by a part of a step, and by `least` at least.

    It is off along the motion alone.
    """
    cos, sin = np.cos(prior[2]), np.sin(prior[2])
    along = (cos * step[0] - sin * step[1], sin * step[0] + cos * step[1], step[2])
    for i in range(3):
        for j in range(3):
            out[i, j] = part * part * along[i] * along[j]
    out[0, 0] += least[0] ** 2
    out[1, 1] += least[0] ** 2
    out[2, 2] += least[1] ** 2


@njit(cache=True, nogil=True)
def _swung(cov, dx, dy, out):  # type: ignore[no-untyped-def]
    """F P F' of a step along the local axes: the error of the heading swings it."""
    a, b, c = cov[0, 0], cov[0, 1], cov[1, 1]
    d, e, t = cov[0, 2], cov[1, 2], cov[2, 2]
    out[0, 0] = a - 2.0 * dy * d + dy * dy * t
    out[0, 1] = out[1, 0] = b + dx * d - dy * e - dx * dy * t
    out[1, 1] = c + 2.0 * dx * e + dx * dx * t
    out[0, 2] = out[2, 0] = d - dy * t
    out[1, 2] = out[2, 1] = e + dx * t
    out[2, 2] = t


@njit(cache=True, nogil=True)
def fuse(prior, expected, held, trust, noise, pose, per_point, variance, jitter, told, room):  # type: ignore[no-untyped-def]  # noqa: C901
    """What the match said, from where prior and match met.

    The top of both, `pose`, has H (match - pose) = trust held (pose - prior): so the match alone
    would have been at pose + H^-1 trust held (pose - prior).

    Args:
        prior: (3,).
        expected: (3, 3) covariance of the prior.
        held: (3, 3) its inverse.
        trust: how much of `held` was used, 0 to 1.
        noise: (4,) variances of the step, as in `predict`.
        pose: (3,) of both.
        per_point: (3, 3) sum of the points' information at a variance of 1.
        variance: of a point that counts for one.
        jitter: (3, 3) covariance of the pose by what no point shows, a late stamp.
        told: (3 + 9 + 9 + 9,) written: innovation, its covariance S, information of the match, and
            that without jitter.
        room: (3, 3, 3) scratch.

    Returns:
        r' S^-1 r.
    """
    H, R, S = room[0], room[1], room[2]
    for i in range(3):
        for j in range(3):
            H[i, j] = per_point[i, j] / variance
    H[0, 0] += 1.0 / ANYWHERE_M**2
    H[1, 1] += 1.0 / ANYWHERE_M**2
    H[2, 2] += 1.0 / ANYWHERE_RAD**2
    inverse(H, R)
    ex, ey = pose[0] - prior[0], pose[1] - prior[1]
    et = (pose[2] - prior[2] + np.pi) % (2.0 * np.pi) - np.pi
    gx = held[0, 0] * ex + held[0, 1] * ey + held[0, 2] * et
    gy = held[1, 0] * ex + held[1, 1] * ey + held[1, 2] * et
    gt = held[2, 0] * ex + held[2, 1] * ey + held[2, 2] * et
    gx, gy, gt = trust * gx, trust * gy, trust * gt
    told[0] = ex + R[0, 0] * gx + R[0, 1] * gy + R[0, 2] * gt
    told[1] = ey + R[1, 0] * gx + R[1, 1] * gy + R[1, 2] * gt
    told[2] = et + R[2, 0] * gx + R[2, 1] * gy + R[2, 2] * gt
    for i in range(3):
        for j in range(3):
            told[21 + 3 * i + j] = H[i, j]
            R[i, j] += jitter[i, j]
    inverse(R, H)
    for i in range(3):
        for j in range(3):
            told[12 + 3 * i + j] = H[i, j]
    for i in range(3):
        for j in range(3):
            S[i, j] = expected[i, j] + R[i, j]
            if i == j:
                S[i, j] += noise[3 if i == 2 else 2] - noise[1 if i == 2 else 0]
            told[3 + 3 * i + j] = S[i, j]
    inverse(S, H)
    nis = 0.0
    for i in range(3):
        for j in range(3):
            nis += told[i] * H[i, j] * told[j]
    return nis


@njit(cache=True, nogil=True)
def learn(noise, told, learned):  # type: ignore[no-untyped-def]
    """Learn from an innovation what odometry misses, axis by axis.

    By expectation and maximization: the expected square of what was missed, given the innovation
    (Shumway and Stoffer 1982, An approach to time series smoothing and forecasting using the EM
    algorithm), averaged over the scans before.

    Args:
        noise: (4,) variances of the step, as in `predict`.
        told: of `fuse`.
        learned: (3,) as in `predict`; updated.
    """
    if noise[2] <= 4.0 * LEAST_M**2:
        return
    learned[2] = min(learned[2] + 1.0, MOST_SCANS)
    missed = 0.5 * (
        _missed(told[0], noise[2], told[3] - noise[2])
        + _missed(told[1], noise[2], told[7] - noise[2])
    )
    missed_yaw = _missed(told[2], noise[3], told[11] - noise[3])
    learned[0] *= 1.0 + (missed - 1.0) / learned[2]
    learned[1] *= 1.0 + (missed_yaw - 1.0) / learned[2]
    for i in range(2):
        learned[i] = min(max(learned[i], LEAST_FACTOR), MOST_FACTOR)


@njit(cache=True, nogil=True)
def _missed(innovation, noise, rest):  # type: ignore[no-untyped-def]
    """Expected square of what odometry missed over its variance, given an innovation."""
    gain = noise / (noise + rest)
    square = min(innovation * innovation / (noise + rest), MOST_SQUARES)
    return gain * square + 1.0 - gain


@njit(cache=True, nogil=True)
def both(carried, information, out, room):  # type: ignore[no-untyped-def]
    """(3, 3) covariance from what odometry carried since the node and the match's information."""
    A = room[0]
    inverse(carried, A)
    for i in range(3):
        for j in range(3):
            A[i, j] += information[i, j]
    inverse(A, out)


@njit(cache=True, nogil=True)
def carry_on(carried, dx, dy, noise, room):  # type: ignore[no-untyped-def]
    """Odometry's covariance since the node, one step on, in place."""
    out = room[0]
    _swung(carried, dx, dy, out)
    for i in range(3):
        for j in range(3):
            carried[i, j] = out[i, j]
    carried[0, 0] += noise[2]
    carried[1, 1] += noise[2]
    carried[2, 2] += noise[3]


@njit(cache=True, nogil=True)
def inverse(A, out):  # type: ignore[no-untyped-def]
    """The inverse of a symmetric positive definite 3x3 A by cofactors."""
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c01 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c02 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    det = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    out[0, 0] = c00 / det
    out[0, 1] = out[1, 0] = c01 / det
    out[0, 2] = out[2, 0] = c02 / det
    out[1, 1] = (A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0]) / det
    out[1, 2] = out[2, 1] = (A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1]) / det
    out[2, 2] = (A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]) / det
