"""What moves the robot and tells how it moved: odometry, IMU, velocities, commands, joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from slamreplay.export.formats import NotAsRecorded
from slamreplay.export.recorded.selection import Rows
from slamreplay.export.recorded.stream import (
    Composer,
    Encoded,
    Stream,
    given,
    groups,
    header_stamps,
)
from slamreplay.geometry.times import NO_STAMP

_NO_TURN = (0.0, 0.0, 0.0, 1.0)


def motion(rows: Mapping[str, Rows], ros: Composer) -> Encoded:
    """Streams of the tables odometry, imu, magnetic_fields, velocities, commands and joints."""
    measured = set(rows["velocities"].of_topics())
    streams, missed = [], []
    for topic, own in rows["odometry"].of_topics().items():
        if topic not in measured:  # else it was made of them, and will be again
            streams.append(_odometry(topic, own, ros))
    streams += [_imu(topic, own, ros) for topic, own in rows["imu"].of_topics().items()]
    streams += [
        _field(topic, own, ros) for topic, own in rows["magnetic_fields"].of_topics().items()
    ]
    streams += [_velocity(topic, own, ros) for topic, own in rows["velocities"].of_topics().items()]
    for topic, own in rows["commands"].of_topics().items():
        turn = own.table["angular_velocity_xyz"]
        told = np.isfinite(turn).all(axis=1)
        if not told.all():
            reason = "steered: the angle was not kept"
            missed.append(NotAsRecorded(topic, int((~told).sum()), reason))
        if told.any():
            streams.append(_command(topic, own.take(told), ros))
    streams += [_joints(topic, own, ros) for topic, own in rows["joints"].of_topics().items()]
    return Encoded(streams, missed)


def _odometry(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)
    pose_cov, twist_cov = given(t["pose_covariance"]), given(t["twist_covariance"])
    place, turn = t["position_xyz"].tolist(), t["orientation_xyzw"].tolist()
    linear, angular = t["linear_velocity_xyz"].tolist(), t["angular_velocity_xyz"].tolist()

    def message(i: int) -> Any:
        return ros.make(
            "nav_msgs/Odometry",
            header=ros.header(stamps[i], t["frame_id"][i]),
            child_frame_id=t["child_frame_id"][i],
            pose=ros.pose_with_covariance_of(place[i], turn[i], pose_cov[i]),
            twist=ros.twist_with_covariance_of(linear[i], angular[i], twist_cov[i]),
        )

    return Stream(topic, "nav_msgs/Odometry", rows.t_log_ns, message)


def _imu(topic: str, rows: Rows, ros: Composer) -> Stream:
    """A quantity that was not measured has a covariance that starts with -1."""
    t, stamps = rows.table, header_stamps(rows.table)
    values, covariances = {}, {}
    for name in ("orientation", "angular_velocity", "linear_acceleration"):
        suffix = "xyzw" if name == "orientation" else "xyz"
        value, covariance = t[f"{name}_{suffix}"].copy(), t[f"{name}_covariance"].copy()
        absent = np.isnan(value).all(axis=1)
        value[absent] = _NO_TURN if name == "orientation" else 0.0
        covariance[absent] = 0.0
        covariance[absent, 0] = -1.0
        values[name], covariances[name] = value.tolist(), given(covariance)

    def message(i: int) -> Any:
        turn = dict(zip("xyzw", values["orientation"][i], strict=True))
        return ros.make(
            "sensor_msgs/Imu",
            header=ros.header(stamps[i], t["frame_id"][i]),
            orientation=ros.make("geometry_msgs/Quaternion", **turn),
            orientation_covariance=covariances["orientation"][i],
            angular_velocity=ros.vector_of(values["angular_velocity"][i]),
            angular_velocity_covariance=covariances["angular_velocity"][i],
            linear_acceleration=ros.vector_of(values["linear_acceleration"][i]),
            linear_acceleration_covariance=covariances["linear_acceleration"][i],
        )

    return Stream(topic, "sensor_msgs/Imu", rows.t_log_ns, message)


def _field(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)
    covariance, field = given(t["magnetic_field_covariance"]), t["magnetic_field_xyz"].tolist()

    def message(i: int) -> Any:
        return ros.make(
            "sensor_msgs/MagneticField",
            header=ros.header(stamps[i], t["frame_id"][i]),
            magnetic_field=ros.vector_of(field[i]),
            magnetic_field_covariance=covariance[i],
        )

    return Stream(topic, "sensor_msgs/MagneticField", rows.t_log_ns, message)


def _velocity(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)
    covariance = t["twist_covariance"]
    linear, angular = t["linear_velocity_xyz"].tolist(), t["angular_velocity_xyz"].tolist()
    if np.isnan(covariance).all():
        return _stamped(topic, rows, ros, t["frame_id"])
    covariance = given(covariance)

    def message(i: int) -> Any:
        return ros.make(
            "geometry_msgs/TwistWithCovarianceStamped",
            header=ros.header(stamps[i], t["frame_id"][i]),
            twist=ros.twist_with_covariance_of(linear[i], angular[i], covariance[i]),
        )

    return Stream(topic, "geometry_msgs/TwistWithCovarianceStamped", rows.t_log_ns, message)


def _command(topic: str, rows: Rows, ros: Composer) -> Stream:
    t = rows.table
    if (t["t_sensor_ns"] != NO_STAMP).any():
        return _stamped(topic, rows, ros, np.full(len(rows), "", dtype=object))
    linear, angular = t["linear_velocity_xyz"].tolist(), t["angular_velocity_xyz"].tolist()

    def message(i: int) -> Any:
        return ros.twist_of(linear[i], angular[i])

    return Stream(topic, "geometry_msgs/Twist", rows.t_log_ns, message)


def _stamped(topic: str, rows: Rows, ros: Composer, frames: Any) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)
    linear, angular = t["linear_velocity_xyz"].tolist(), t["angular_velocity_xyz"].tolist()

    def message(i: int) -> Any:
        return ros.make(
            "geometry_msgs/TwistStamped",
            header=ros.header(stamps[i], frames[i]),
            twist=ros.twist_of(linear[i], angular[i]),
        )

    return Stream(topic, "geometry_msgs/TwistStamped", rows.t_log_ns, message)


def _joints(topic: str, rows: Rows, ros: Composer) -> Stream:
    """Rows of one moment make one message; what no joint in it tells is an empty list."""
    t, stamps = rows.table, header_stamps(rows.table)
    found = groups(rows.t_log_ns, stamps)

    def message(i: int) -> Any:
        own = found[i]
        told = {}
        for name in ("position", "velocity", "effort"):
            values = t[name][own]
            told[name] = values[:0] if np.isnan(values).all() else values
        return ros.make(
            "sensor_msgs/JointState",
            header=ros.header(stamps[own[0]], ""),
            name=t["name"][own].tolist(),
            **told,
        )

    t_log_ns = rows.t_log_ns[[g[0] for g in found]]
    return Stream(topic, "sensor_msgs/JointState", t_log_ns, message)
