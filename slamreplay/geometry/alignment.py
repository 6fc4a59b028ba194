"""The rigid motion that lays one set of points onto another."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry import se2

_ROUNDS = 20


def aligned(points: se2.Array, onto: se2.Array) -> se2.Array:
    """The planar motion (3,), m and rad, that lays points (N, 2) onto others; far ones count less.

    Umeyama (1991) without scale, weighed anew by Cauchy's weight of the median distance.
    """
    weight, motion = np.ones(len(points)), np.zeros(3)
    for _ in range(_ROUNDS):
        motion = least_squares(points, onto, weight)
        apart = np.hypot(*(se2.transform_points(motion, points) - onto).T)
        weight = 1.0 / (1.0 + (apart / max(1.5 * float(np.median(apart)), 1e-6)) ** 2)
    return motion


def least_squares(points: se2.Array, onto: se2.Array, weight: se2.Array | None = None) -> se2.Array:
    """The planar motion (3,), m and rad, that lays points (N, 2), N > 0, onto others best.

    Least squares (Umeyama 1991, IEEE Trans. PAMI 13, 376-380) without scale and reflection.

    Args:
        points: (N, 2) m.
        onto: (N, 2) m.
        weight: (N,) of each squared distance; all alike by default.
    """
    part = np.ones(len(points)) if weight is None else weight
    part = part[:, None] / part.sum()
    a, b = (part * points).sum(axis=0), (part * onto).sum(axis=0)
    S = (part * (points - a)).T @ (onto - b)
    yaw = np.arctan2(S[0, 1] - S[1, 0], S[0, 0] + S[1, 1])
    turned = se2.transform_points(np.array([0.0, 0.0, yaw]), a[None])[0]
    return np.array([*(b - turned), yaw])
