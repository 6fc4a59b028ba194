"""Planar poses of a text log as rows of the bundle's tables; frames map, odom and base_link."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.rows import TopicRows


def odometry_rows(
    topic: str,
    kind: str,
    xyyaw: se2.Array,
    velocity: se2.Array,
    t_sensor_ns: Times,
    t_log_ns: Times,
) -> TopicRows:
    """Rows of table odometry: base_link in odom.

    Args:
        topic: name of the topic.
        kind: its type.
        xyyaw: (N, 3) poses.
        velocity: (N, 2) forward in m/s and turn rate in rad/s; NaN where not recorded.
        t_sensor_ns: (N,) stamps.
        t_log_ns: (N,) log times.
    """
    n = len(xyyaw)
    forward, turn = velocity.T
    # A wheeled base that has a forward speed has no other; without one nothing is known.
    no_forward, no_turn = (np.where(np.isfinite(v), 0.0, np.nan) for v in (forward, turn))
    columns = {
        "frame_id": np.full(n, "odom", dtype=object),
        "child_frame_id": np.full(n, "base_link", dtype=object),
        **_pose(xyyaw),
        "pose_covariance": np.full((n, 36), np.nan),
        "linear_velocity_xyz": np.column_stack([forward, no_forward, no_forward]),
        "angular_velocity_xyz": np.column_stack([no_turn, no_turn, turn]),
        "twist_covariance": np.full((n, 36), np.nan),
    }
    return TopicRows(topic, kind, n, "odometry", columns, t_sensor_ns, t_log_ns)


def reference_rows(
    topic: str, kind: str, reference: str, xyyaw: se2.Array, t_sensor_ns: Times, t_log_ns: Times
) -> TopicRows:
    """Rows of table references: base_link in map, poses (N, 3) of a kind that judges."""
    n = len(xyyaw)
    columns = {
        "frame_id": np.full(n, "map", dtype=object),
        "child_frame_id": np.full(n, "base_link", dtype=object),
        "kind": np.full(n, reference, dtype=object),
        **_pose(xyyaw),
        "covariance": np.full((n, 36), np.nan),
    }
    return TopicRows(topic, kind, n, "references", columns, t_sensor_ns, t_log_ns)


def static_rows(
    parent: str, children: Sequence[str], xyyaw: se2.Array, kind: str, t_log_ns: int
) -> TopicRows:
    """Rows of table transforms that hold at all times: frames at poses (N, 3) in a parent."""
    n = len(children)
    pose = _pose(xyyaw)
    columns = {
        "parent_frame": np.full(n, parent, dtype=object),
        "child_frame": np.array([*children, ""], dtype=object)[:-1],
        "is_static": np.ones(n, dtype=bool),
        "translation_xyz": pose["position_xyz"],
        "rotation_xyzw": pose["orientation_xyzw"],
    }
    stamps, times = np.full(n, NO_STAMP), np.full(n, t_log_ns)
    return TopicRows("tf_static", f"{kind}/tf_static", n, "transforms", columns, stamps, times)


def _pose(xyyaw: se2.Array) -> dict[str, se2.Array]:
    position = np.column_stack([xyyaw[:, :2], np.zeros(len(xyyaw))])
    return {"position_xyz": position, "orientation_xyzw": se3.quaternion_from_yaw(xyyaw[:, 2])}
