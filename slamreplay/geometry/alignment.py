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
        part = weight[:, None] / weight.sum()
        a, b = (part * points).sum(axis=0), (part * onto).sum(axis=0)
        S = (part * (points - a)).T @ (onto - b)
        yaw = np.arctan2(S[0, 1] - S[1, 0], S[0, 0] + S[1, 1])
        turned = se2.transform_points(np.array([0.0, 0.0, yaw]), a[None])[0]
        motion = np.array([*(b - turned), yaw])
        apart = np.hypot(*(se2.transform_points(motion, points) - onto).T)
        weight = 1.0 / (1.0 + (apart / max(1.5 * float(np.median(apart)), 1e-6)) ** 2)
    return motion
