"""Odometry of a log that has none: the way its measured twists lead, in the plane.

Between two messages the mean of both twists holds, and the base drives its exact arc: the
exponential map of SE(2) (Sola, Deray and Atchuthan, "A micro Lie theory for state estimation in
robotics", 2018, appendix on SE(2)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import FrameEdge, Frames, Loss
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times
from slamreplay.ingest.names import basename, is_map_frame, is_odom_frame
from slamreplay.ingest.rows import TopicRows

#: A pause between twists that is longer than this is not bridged: nothing says what the robot did.
GAP_NS = NS_PER_S
_WORLD = frozenset({"world", "earth", "enu", "ned"})
#: Slower than this is noise of rest; vertical motion above this share of the whole is no base's.
_MOVING_M_S, _VERTICAL = 0.1, 0.3
#: Directions whose resultant is above the one point one way, below the other they do not.
_ONE_WAY, _ANY_WAY, _FEWEST = 0.9, 0.7, 20


def objection(topic: TopicRows) -> str | None:
    """Why a topic's velocities lead nowhere, None where they do.

    Receivers and inertial units tell velocities along axes of the world, some in a frame that is
    called the robot's. There the direction of motion turns with the heading; along a base's own
    axes it stays, forwards and backwards, be the base turned as it may.
    """
    frame = topic.frame()
    if is_map_frame(frame) or is_odom_frame(frame) or basename(frame) in _WORLD:
        return "along axes of the world, and no heading is known"
    linear = topic.columns["linear_velocity_xyz"]
    across = np.sqrt(np.mean(np.sum(linear[:, :2] ** 2, axis=1)))
    up = np.sqrt(np.mean(linear[:, 2] ** 2))
    if up > _MOVING_M_S and up > _VERTICAL * np.hypot(across, up):
        return "they leave the plane"
    order, t_ns = _in_order(topic)
    twist = _planar(topic.take(order))
    moving = np.hypot(twist[:, 0], twist[:, 1]) > _MOVING_M_S
    if moving.sum() < _FEWEST:
        return None
    along = np.arctan2(twist[moving, 1], twist[moving, 0])
    heading = integrate(t_ns, twist)[moving, 2]
    if _resultant(along) > _ANY_WAY:
        return None
    if not twist[:, 2].any():
        return "they tell no turn rate, and their direction changes"
    if _resultant(along - heading) > _ONE_WAY:
        return "their direction turns with the heading, as along axes of the world"
    return None


def _resultant(angle: NDArray[np.float64]) -> float:
    """Mean resultant length of axes (N,) in rad, 0 to 1: forwards and backwards are one."""
    return float(np.abs(np.mean(np.exp(2.0j * angle))))


def is_carried(tree: Sequence[FrameEdge], frames: Frames) -> bool:
    """Whether tf says how the base moves in odom, be it over frames between."""
    if frames.odom is None or frames.base is None:
        return False
    above = {e.child: e for e in tree}
    lines = []
    for frame in (frames.odom, frames.base):
        line = [frame]
        while line[-1] in above:
            line.append(above[line[-1]].parent)
        lines.append(line)
    apart = set(lines[0]) ^ set(lines[1])  # what lies below the nearest frame above both
    return lines[0][-1] == lines[1][-1] and any(not above[f].is_static for f in apart)


def dead_reckoned(
    topic: TopicRows, tree: Sequence[FrameEdge], base: str | None
) -> tuple[TopicRows, list[Loss]]:
    """Rows of table odometry from rows of table velocities, and what was made and left out.

    Of a log with pauses longer than `GAP_NS` the longest unbroken stretch is kept: how the poses
    before a pause lie to those after it is not known.

    Args:
        topic: measured velocities, in the frame that moves.
        tree: edges of tf; where an odom frame is on it already, the rows get a frame of their own.
        base: the robot's base, for twists that name no frame.
    """
    order, t_ns = _in_order(topic)
    start, end = _longest(t_ns)
    kept = topic.take(order[start:end])
    known = {f for e in tree for f in (e.parent, e.child)}
    frame = "dead_reckoning" if any(is_odom_frame(f) for f in known) else "odom"
    n = len(kept)
    xyyaw = integrate(t_ns[start:end], _planar(kept))
    columns = {
        "frame_id": np.full(n, frame, dtype=object),
        "child_frame_id": np.full(n, topic.frame() or base or "base_link", dtype=object),
        "position_xyz": np.column_stack([xyyaw[:, :2], np.zeros(n)]),
        "orientation_xyzw": se3.quaternion_from_yaw(xyyaw[:, 2]),
        "pose_covariance": np.full((n, 36), np.nan),
        "linear_velocity_xyz": kept.columns["linear_velocity_xyz"],
        "angular_velocity_xyz": kept.columns["angular_velocity_xyz"],
        "twist_covariance": kept.columns["twist_covariance"],
    }
    rows = replace(kept, table="odometry", columns=columns)
    reason = "the log has no odometry: dead-reckoned from these twists"
    losses = [Loss(kind="repaired", what=topic.topic, count=n, reason=reason)]
    if len(topic) > n:
        reason = f"not dead-reckoned: across a pause of more than {GAP_NS // NS_PER_S} s"
        losses.append(Loss(kind="skipped", what=topic.topic, count=len(topic) - n, reason=reason))
    return rows, losses


def integrate(t_ns: Times, twist: NDArray[np.float64]) -> se2.Array:
    """Poses (N, 3) in the first one's frame.

    Args:
        t_ns: (N,) sorted times.
        twist: (N, 3) m/s, m/s, rad/s in the moving frame.
    """
    span = (np.diff(t_ns) / NS_PER_S)[:, None]
    step = span * (twist[:-1] + twist[1:]) / 2.0
    turn = step[:, 2]
    # np.sinc(x) is sin(pi x) / (pi x): both stay exact where the turn goes to zero.
    along = np.sinc(turn / np.pi)
    across = np.sin(turn / 2.0) * np.sinc(turn / (2.0 * np.pi))
    x = along * step[:, 0] - across * step[:, 1]
    y = across * step[:, 0] + along * step[:, 1]
    yaw = np.append(0.0, np.cumsum(turn))
    cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    return np.column_stack(
        [
            np.append(0.0, np.cumsum(cos * x - sin * y)),
            np.append(0.0, np.cumsum(sin * x + cos * y)),
            se2.wrap_angle(yaw),
        ]
    )


def _planar(topic: TopicRows) -> NDArray[np.float64]:
    linear, angular = (topic.columns[f"{n}_velocity_xyz"] for n in ("linear", "angular"))
    return np.column_stack([linear[:, :2], angular[:, 2]])


def _in_order(topic: TopicRows) -> tuple[NDArray[np.int64], Times]:
    """Rows in order of time and their times: stamps where all are there and none jumps back."""
    stamps, t_ns = topic.t_sensor_ns, topic.t_log_ns
    if (stamps != NO_STAMP).all() and (np.diff(stamps) > -GAP_NS).all():
        t_ns = stamps
    order = np.argsort(t_ns, kind="stable")
    return order, t_ns[order]


def _longest(t_ns: Times) -> tuple[int, int]:
    """Range of the longest time without a pause; the first of several."""
    breaks = np.flatnonzero(np.diff(t_ns) > GAP_NS) + 1
    starts, ends = np.append(0, breaks), np.append(breaks, len(t_ns))
    best = int(np.argmax(t_ns[ends - 1] - t_ns[starts]))
    return int(starts[best]), int(ends[best])
