"""Steps no robot makes: jumps of odometry, and how far a correction moved the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.audit.streams import Stream
from slamreplay.bundle.manifest import Clock
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S, Times

#: What a step may add to the motion around it: noise and resolution, and full acceleration.
_FLOOR_M, _FLOOR_RAD = 0.05, 0.1
_MOST_M_S2, _MOST_RAD_S2 = 10.0, 20.0
#: A step may be so many times as fast as the steps around it, of which so many are looked at.
_FASTER, _AROUND = 3.0, 5


@dataclass(frozen=True, eq=False)
class Steps:
    """N steps of a pose.

    Attributes:
        t_ns: (N,) when each was over, on the bundle's clock.
        metres: (N,) how far.
        radians: (N,) how far it turned, without sign.
    """

    t_ns: Times
    metres: se2.Array
    radians: se2.Array

    def __len__(self) -> int:
        return len(self.t_ns)


def odometry_jumps(track: PoseTrack) -> Steps:
    """Steps of dead reckoning that are faster than the motion around them allows.

    REP-105 has odom -> base continuous. The limit is three times the median speed of the ten steps
    around, plus what an acceleration of 10 m/s^2 (20 rad/s^2) and 5 cm (0.1 rad) of noise add.
    """
    t, poses = track.t_ns, track.xyyaw
    if len(t) < 2 * _AROUND:
        return Steps(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    step = se2.between(poses[:-1], poses[1:])
    seconds = np.diff(t) / NS_PER_S
    metres, radians = np.hypot(step[:, 0], step[:, 1]), np.abs(step[:, 2])
    drift = 0.5 * seconds**2
    most_m = _FASTER * _speed(metres, seconds) * seconds + _MOST_M_S2 * drift + _FLOOR_M
    most_rad = _FASTER * _speed(radians, seconds) * seconds + _MOST_RAD_S2 * drift + _FLOOR_RAD
    rows = np.flatnonzero((metres > most_m) | (radians > most_rad))
    return Steps(t[rows + 1], metres[rows], radians[rows])


def _speed(way: se2.Array, seconds: se2.Array) -> se2.Array:
    """(N,) the median speed of the steps around each."""
    speed = way / np.maximum(seconds, 1e-3)
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(speed, _AROUND, mode="reflect"), 2 * _AROUND + 1
    )
    return np.asarray(np.median(np.delete(windows, _AROUND, axis=1), axis=1))


@dataclass(frozen=True, eq=False)
class Corrections:
    """What each word of the localizer changed, where the robot was at that time.

    Attributes:
        at_robot: how the robot's place in the map moved.
        at_origin: (N,) m, how the odometry frame's origin moved: a turn far away makes it large
            where the robot hardly moved.
    """

    at_robot: Steps
    at_origin: se2.Array

    def __len__(self) -> int:
        return len(self.at_robot)


def corrections(
    edges: Sequence[Stream],
    transforms: Table,
    frames: tuple[str, str],
    odometry: PoseTrack,
    clock: Clock,
) -> Corrections | None:
    """Steps of map -> odom at the robot: T_map_base before and after, at the same T_odom_base.

    Args:
        edges: streams of tf.
        transforms: their rows.
        frames: map and odom; either may be the parent of the other.
        odometry: the base in odom.
        clock: tells when a correction arrived, for its stamp may be dated ahead.
    """
    own = [s for s in edges if s.is_edge(*frames) and not s.is_static]
    if not own or not len(odometry):
        return None
    stream = max(own, key=len)
    T = se3.matrix(transforms["translation_xyz"][stream.rows],
                   transforms["rotation_xyzw"][stream.rows])  # fmt: skip
    correction = se3.planar(T)
    if stream.edge == (frames[1], frames[0]):
        correction = se2.inverse(correction)
    arrived = clock.from_log_time(stream.t_log_ns)
    base = odometry.at(arrived).xyyaw
    before, after = se2.compose(correction[:-1], base[1:]), se2.compose(correction[1:], base[1:])
    moved = after - before
    known = np.isfinite(moved).all(axis=1)
    steps = Steps(
        arrived[1:][known],
        np.hypot(moved[known, 0], moved[known, 1]),
        np.abs(se2.wrap_angle(moved[known, 2])),
    )
    origin = np.diff(correction, axis=0)[known]
    return Corrections(steps, np.hypot(origin[:, 0], origin[:, 1]))
