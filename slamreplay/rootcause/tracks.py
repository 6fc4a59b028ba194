"""Paths cut into steps, mended, and put together again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2


def steps_of(poses: se2.Array) -> se2.Array:
    """(N - 1, 3) motion from each pose (N, 3) to the next, in the frame of the earlier one."""
    return se2.between(poses[:-1], poses[1:])


def put_together(start: se2.Array, steps: se2.Array) -> se2.Array:
    """(N, 3) poses that begin at a pose (3,) and go on by steps (N - 1, 3)."""
    yaw = start[2] + np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    dx, dy = cos * steps[:, 0] - sin * steps[:, 1], sin * steps[:, 0] + cos * steps[:, 1]
    x = start[0] + np.concatenate([[0.0], np.cumsum(dx)])
    y = start[1] + np.concatenate([[0.0], np.cumsum(dy)])
    return np.column_stack([x, y, se2.wrap_angle(yaw)])


def filled(t_ns: NDArray[np.int64], where: se2.Array, odometry: se2.Array) -> se2.Array:
    """Poses (N, 3) with their NaN rows filled: carried by odometry between known neighbours.

    The correction map to odom is interpolated, so that a robot that was carried moves all the way.
    Without odometry the pose itself is.
    """
    known = np.isfinite(where).all(axis=1)
    if known.all() or not known.any():
        return where
    told = np.isfinite(odometry).all(axis=1)
    out = where.copy()
    both = known & told
    if both.any():
        correction = se2.compose(where[both], se2.inverse(odometry[both]))
        rows = ~known & told
        if rows.any():
            at = np.clip(t_ns[rows], t_ns[both][0], t_ns[both][-1])
            there = se2.interpolate(t_ns[both], correction, at)
            out[rows] = se2.compose(there, odometry[rows])
        known = known | rows
    if not known.all():
        at = np.clip(t_ns[~known], t_ns[known][0], t_ns[known][-1])
        out[~known] = se2.interpolate(t_ns[known], out[known], at)
    return out
