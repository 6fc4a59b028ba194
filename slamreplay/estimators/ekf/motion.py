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


class Motion:
    """The path of odometry, its constant errors removed, with running sums of unit noise.

    Noise of the heading is spread evenly along each step and turns all that is driven after it;
    for one straight step of length d with variance q of heading this gives the lateral variance
    q d^2 / 3, the covariance q d / 2 and the heading's q: a Wiener process integrated once
    (Bar-Shalom, Li, Kirubarajan 2001, section 6.2.2). It does not depend on how often odometry is
    sampled. What gathers between two times is a difference of running sums over the steps.

    Args:
        track: base in odom, sorted, every row a pose.
        noise: of which only the constant errors of odometry count here.
    """

    def __init__(self, track: PoseTrack, noise: Noise) -> None:
        self.track = track
        path = _calibrated(track.xyyaw, noise)
        path[:, :2] -= path[:1, :2]  # sums of squares of large places would cancel badly
        self._path = path
        self._step = np.diff(path, axis=0)
        self._step[:, 2] = se2.wrap_angle(self._step[:, 2])
        moments = np.cumsum(_moments(path[:-1], self._step), axis=0)
        self._before = np.concatenate([np.zeros_like(moments[:1]), moments])
        # Of the times that were asked for last: settings change more often than times.
        self._known: tuple[NDArray[np.int64], NDArray[np.bool_]] | None = None
        self._gathered: tuple[NDArray[np.int64], se2.Array, se2.Array] | None = None

    def known(self, t_ns: NDArray[np.int64], noise: Noise) -> NDArray[np.bool_]:
        """(N,) whether odometry says anything of times (N,) on the sightings' clock."""
        at_ns = t_ns - ns(noise.odometry_delay_s)
        if self._known is None or not np.array_equal(self._known[0], at_ns):
            self._known = at_ns, self.track.at(at_ns).has_pose
        return self._known[1]

    def steps(self, t_ns: NDArray[np.int64], noise: Noise) -> Steps:
        """Increments between times and their covariance.

        Args:
            t_ns: (E,) sorted times that are `known`.
            noise: how odometry scatters, and its delay.
        """
        at_ns = t_ns - ns(noise.odometry_delay_s)
        if not len(at_ns) or not len(self._step):
            return Steps(np.zeros((len(t_ns), 3)), np.zeros((len(t_ns), 3, 3)))
        if self._gathered is None or not np.array_equal(self._gathered[0], at_ns):
            self._gathered = at_ns, *self._gather(at_ns)
        _, pose, moments = self._gathered
        before = pose[np.maximum(np.arange(len(pose)) - 1, 0)]
        Q = _covariance(moments, _left(pose), noise)
        return Steps(se2.between(before, pose), turned(Q, -before[:, 2]))

    def _gather(self, at_ns: NDArray[np.int64]) -> tuple[se2.Array, se2.Array]:
        """Poses (E, 3) at times of odometry, and the moments (E, 2, 6) of the way to each."""
        t = self.track.t_ns
        k = np.clip(np.searchsorted(t, at_ns, side="right") - 1, 0, max(len(t) - 2, 0))
        share = np.clip((at_ns - t[k]) / (t[k + 1] - t[k]), 0.0, 1.0)[:, None]
        part = share * self._step[k]
        until = self._before[k] + _moments(self._path[k], part)
        return self._path[k] + part, np.diff(until, axis=0, prepend=until[:1])


def _moments(start: se2.Array, step: se2.Array) -> se2.Array:
    """(N, 2, 6) of single steps (N, 3) from poses (N, 3): sums of w (1, x, y, x x, x y, y y).

    The weight w is the length, then the size of the turn, spread evenly along the step, and (x, y)
    the lever of a turn there: how the origin would move.
    """
    lever, along = _left(start + 0.5 * step), _left(step)
    (x, y), (dx, dy) = lever.T, along.T
    l_ = np.column_stack(
        [np.ones_like(x), x, y, x * x + dx * dx / 12, x * y + dx * dy / 12, y * y + dy * dy / 12]
    )
    w = np.column_stack([np.hypot(step[:, 0], step[:, 1]), np.abs(step[:, 2])])
    return np.asarray(w[:, :, None] * l_[:, None, :])


def _covariance(moments: se2.Array, end: se2.Array, noise: Noise) -> se2.Array:
    """(E, 3, 3) of motions, in axes of odom, from their moments (E, 2, 6) and end levers (E, 2).

    A turn by e at lever l moves an end at lever m by e (m - l).
    """
    q = noise.heading_per_metre**2 * moments[:, 0] + noise.heading_per_turn**2 * moments[:, 1]
    straight = noise.position_per_metre**2 * moments[:, 0, 0]
    (x, y), (s, sx, sy, sxx, sxy, syy) = end.T, q.T
    Q = np.empty((len(q), 3, 3))
    Q[:, 0, 0] = s * x * x - 2.0 * x * sx + sxx + straight
    Q[:, 1, 1] = s * y * y - 2.0 * y * sy + syy + straight
    Q[:, 0, 1] = Q[:, 1, 0] = s * x * y - x * sy - y * sx + sxy
    Q[:, 0, 2] = Q[:, 2, 0] = s * x - sx
    Q[:, 1, 2] = Q[:, 2, 1] = s * y - sy
    Q[:, 2, 2] = s
    return Q


def _calibrated(xyyaw: se2.Array, noise: Noise) -> se2.Array:
    """The path (N, 3) integrated anew from increments without their constant errors."""
    step = np.diff(xyyaw, axis=0)
    told = se2.wrap_angle(step[:, 2])
    middle = xyyaw[:-1, 2] + 0.5 * told
    forward = np.cos(middle) * step[:, 0] + np.sin(middle) * step[:, 1]
    turn = noise.turn_ratio * told + noise.turn_per_metre * noise.distance_ratio * forward
    yaw = xyyaw[0, 2] + np.append(0.0, np.cumsum(turn))
    off = yaw[:-1] + 0.5 * turn - middle
    cos, sin = noise.distance_ratio * np.cos(off), noise.distance_ratio * np.sin(off)
    x = xyyaw[0, 0] + np.append(0.0, np.cumsum(cos * step[:, 0] - sin * step[:, 1]))
    y = xyyaw[0, 1] + np.append(0.0, np.cumsum(sin * step[:, 0] + cos * step[:, 1]))
    return np.column_stack([x, y, yaw])


def _left(xyyaw: se2.Array) -> se2.Array:
    """(N, 2) places turned by 90 degrees to the left: how a point moves as the heading does."""
    return np.column_stack([-xyyaw[:, 1], xyyaw[:, 0]])
