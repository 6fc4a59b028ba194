"""Odometry as increments between any times, with the noise that gathers on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.geometry.times import ns


@dataclass(frozen=True, eq=False)
class Steps:
    """The motion from each of E times to the next, in axes of the base at the earlier one.

    Attributes:
        xyyaw: (E, 3) the base at each time, seen from the base at the time before; zero for the
            first.
        Q: (E, 3, 3) covariance of it, m^2 and rad^2.
    """

    xyyaw: se2.Array
    Q: se2.Array


def odometry_known(track: PoseTrack, t_ns: NDArray[np.int64], noise: Noise) -> NDArray[np.bool_]:
    """(N,) whether odometry says anything of times (N,) on the sightings' clock."""
    return track.at(t_ns - ns(noise.odometry_delay_s)).has_pose


def steps_between(track: PoseTrack, t_ns: NDArray[np.int64], noise: Noise) -> Steps:
    """Increments of odometry between times, and their covariance.

    Noise of the heading is spread evenly along each step and turns all that is driven after it;
    for one straight step of length d with variance q of heading this gives the lateral variance
    q d^2 / 3, the covariance q d / 2 and the heading's q: a Wiener process integrated once
    (Bar-Shalom, Li, Kirubarajan 2001, section 6.2.2). It does not depend on how often odometry is
    sampled. The sums over the steps between two times are differences of running sums.

    Args:
        track: base in odom.
        t_ns: (E,) sorted times at which odometry is known (see `odometry_known`).
        noise: how odometry scatters, its constant errors and its delay.
    """
    if not len(t_ns):
        return Steps(np.empty((0, 3)), np.empty((0, 3, 3)))
    at_ns = t_ns - ns(noise.odometry_delay_s)
    inside = track.t_ns[(track.t_ns > at_ns[0]) & (track.t_ns < at_ns[-1])]
    t = np.unique(np.concatenate([inside, at_ns]))
    path = track.at(t)
    t, xyyaw = t[path.has_pose], path.xyyaw[path.has_pose]
    xyyaw = _calibrated(xyyaw, noise.distance_ratio, noise.turn_ratio)
    rows = np.searchsorted(t, at_ns)

    step = np.diff(xyyaw, axis=0, prepend=xyyaw[:1])
    step[:, 2] = se2.wrap_angle(step[:, 2])
    length, turn = np.hypot(step[:, 0], step[:, 1]), np.abs(step[:, 2])
    middle = xyyaw[:, :2] - xyyaw[0, :2] - 0.5 * step[:, :2]
    q = noise.heading_per_metre**2 * length + noise.heading_per_turn**2 * turn
    lever, along = _left(middle), _left(step[:, :2])
    outer = lever[:, :, None] * lever[:, None, :] + along[:, :, None] * along[:, None, :] / 12.0

    s0 = _summed(q, rows)
    s1 = _summed(q[:, None] * lever, rows)
    s2 = _summed(q[:, None, None] * outer, rows)
    s3 = _summed(noise.position_per_metre**2 * length, rows)
    end = _left(xyyaw[rows, :2] - xyyaw[0, :2])
    Q = np.zeros((len(rows), 3, 3))
    cross = end[:, :, None] * s1[:, None, :]
    Q[:, :2, :2] = (
        s0[:, None, None] * end[:, :, None] * end[:, None, :]
        - (cross + np.swapaxes(cross, 1, 2))
        + s2
        + s3[:, None, None] * np.eye(2)
    )
    Q[:, :2, 2] = Q[:, 2, :2] = s0[:, None] * end - s1
    Q[:, 2, 2] = s0
    pose = xyyaw[rows]
    before = pose[np.maximum(np.arange(len(rows)) - 1, 0)]
    return Steps(se2.between(before, pose), turned(Q, -before[:, 2]))


def _calibrated(xyyaw: se2.Array, distance_ratio: float, turn_ratio: float) -> se2.Array:
    """The path (N, 3) integrated anew from increments of other size, from the same pose."""
    if distance_ratio == 1.0 and turn_ratio == 1.0:
        return xyyaw
    step = np.diff(xyyaw, axis=0)
    turn = se2.wrap_angle(step[:, 2])
    told = xyyaw[:-1, 2] + 0.5 * turn  # heading in the middle of each step
    yaw = xyyaw[0, 2] + turn_ratio * np.append(0.0, np.cumsum(turn))
    off = yaw[:-1] + 0.5 * turn_ratio * turn - told
    cos, sin = distance_ratio * np.cos(off), distance_ratio * np.sin(off)
    x = xyyaw[0, 0] + np.append(0.0, np.cumsum(cos * step[:, 0] - sin * step[:, 1]))
    y = xyyaw[0, 1] + np.append(0.0, np.cumsum(sin * step[:, 0] + cos * step[:, 1]))
    return np.column_stack([x, y, se2.wrap_angle(yaw)])


def _left(xy: se2.Array) -> se2.Array:
    """(N, 2) vectors turned by 90 degrees to the left: how a point moves as the heading does."""
    return np.column_stack([-xy[:, 1], xy[:, 0]])


def _summed(values: se2.Array, rows: NDArray[np.int64]) -> se2.Array:
    """Sums (E, ...) of values (N, ...) after the row before up to each row; zero for the first."""
    total = np.cumsum(values, axis=0)[rows]
    return np.concatenate([np.zeros_like(total[:1]), np.diff(total, axis=0)])
