"""What one more stage in front of the localizer's answer would do to those who use the pose.

A stage delays each answer by its length; one that takes longer than the answers' period also makes
them fewer. Whoever uses a correction as it is then acts on where the robot was. Whoever carries it
on by odometry, as tf does, lacks only what odometry counted wrong since, and its last sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slamreplay.geometry import se2
from slamreplay.verdict.latency.ages import Ages, ages, motion_since
from slamreplay.verdict.latency.consumers import Consumer
from slamreplay.verdict.latency.latency import Latency


@dataclass(frozen=True)
class Reach:
    """What turns motion into an error where it matters.

    Attributes:
        lever_m: how far ahead of the robot's centre a place is that a wrong heading moves.
        odometry_error: share of way and turn that odometry counts wrong while it carries.
    """

    lever_m: float = 1.0
    odometry_error: float = 0.05


@dataclass(frozen=True, eq=False)
class Lag:
    """N uses of the pose behind a stage.

    Attributes:
        ages: with the stage.
        held: (N, 3) motion that is unknown to whoever takes the correction as it is, x along, y to
            the left, yaw, in the robot's frame when it is used; NaN where nothing tells.
        carried: (N, 3) the same where odometry carries it, without odometry's own error.
        way_m: (N,) way over which it carries,
        turn_rad: (N,) and turn: of these a share is counted wrong.
    """

    ages: Ages
    held: se2.Array
    carried: se2.Array
    way_m: se2.Array
    turn_rad: se2.Array

    def held_m(self, reach: Reach) -> se2.Array:
        """(N,) error without odometry, at the lever: way, and turn times lever."""
        return _size(self.held, reach)

    def carried_m(self, reach: Reach) -> se2.Array:
        """(N,) error with odometry, at the lever."""
        return _size(self.carried, reach) + self.miscounted_m(reach)

    def miscounted_m(self, reach: Reach) -> se2.Array:
        """(N,) what odometry counts wrong while it carries, in any direction."""
        wrong = self.way_m + self.turn_rad * reach.lever_m
        return np.asarray(reach.odometry_error * wrong)


def behind(found: Latency, user: Consumer, stage_ns: int) -> Lag:
    """A consumer's ages and unknown motion with a stage before the localizer's answer.

    Args:
        found: the log's ages.
        user: one of its consumers.
        stage_ns: how long the stage takes; 0 for the log as it is.
    """
    said = None if found.said is None else found.said.through(stage_ns)
    late = ages(user, said, found.odometry)
    held = motion_since(found.track, late.measured_ns, user.t_ns)
    carried = motion_since(found.track, late.read_ns, user.t_ns)
    return Lag(
        late,
        _at_use(held),
        _at_use(carried),
        np.hypot(held[:, 0], held[:, 1]),
        np.abs(held[:, 2]),
    )


def towards(motion: se2.Array, direction_xy: se2.Array, lever_m: float) -> se2.Array:
    """(N,) how much nearer an obstacle may be than a motion (N, 3) that is unknown lets think.

    Args:
        motion: x along, y to the left, yaw, in the robot's frame.
        direction_xy: (N, 2) or (2,) unit vector to the obstacle in the same frame.
        lever_m: a turn moves what is so far ahead, to the side.
    """
    u = np.broadcast_to(direction_xy, (len(motion), 2))
    along = np.abs(np.sum(motion[:, :2] * u, axis=1))
    return np.asarray(along + np.abs(motion[:, 2]) * lever_m * np.abs(u[:, 1]))


@dataclass(frozen=True)
class Blocked:
    """A loop that waits for a stage in each cycle.

    Attributes:
        loop_hz: its rate without.
        stage_s: how long the stage takes.
        work_s: how long its own work takes.
        share: of the cycle that stage and work take; more than 1 is too long.
        missed: cycles that pass before the next one begins.
        late_s: how long after it was due the next one begins.
        rate_hz: what is left of the rate, where the next cycle begins as soon as it can.
    """

    loop_hz: float
    stage_s: float
    work_s: float
    share: float
    missed: int
    late_s: float
    rate_hz: float


def blocked(loop_hz: float, stage_s: float, work_s: float = 0.0) -> Blocked:
    """What a stage of a length does to a loop that waits for it."""
    busy, cycle = stage_s + work_s, 1.0 / loop_hz
    missed = max(math.ceil(busy / cycle - 1e-9) - 1, 0)
    late = max(busy - cycle, 0.0)
    return Blocked(loop_hz, stage_s, work_s, busy / cycle, missed, late, 1.0 / max(busy, cycle))


def _at_use(motion: se2.Array) -> se2.Array:
    """Motions (N, 3) in the frame where they end, not where they begin."""
    turned = np.column_stack([np.zeros((len(motion), 2)), -motion[:, 2]])
    xy = se2.transform_points(turned, motion[:, None, :2])[:, 0]
    return np.column_stack([xy, motion[:, 2]])


def _size(motion: se2.Array, reach: Reach) -> se2.Array:
    way = np.hypot(motion[:, 0], motion[:, 1])
    return np.asarray(way + np.abs(motion[:, 2]) * reach.lever_m)
