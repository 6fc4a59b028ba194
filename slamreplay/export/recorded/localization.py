"""Where the robot believed to be and by what: poses, particles, transforms, scores."""

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

#: Topics of als_ros, whose numbers come as a vector.
_VECTORS = frozenset({"reliability", "failure_probability"})


def localization(rows: Mapping[str, Rows], ros: Composer) -> Encoded:
    """Streams of the tables poses, initial_poses, particles, transforms and signals."""
    poses = rows["poses"]
    told = poses.take(poses.table["source"] == "topic")  # the others are transforms, written below
    streams = [pose_stream(topic, own, ros) for topic, own in told.of_topics().items()]
    for topic, own in rows["initial_poses"].of_topics().items():
        name = "/initialpose" if topic.endswith("/_service_event") else topic
        streams.append(pose_stream(name, own, ros, with_covariance=True))
    streams += [_particles(topic, own, ros) for topic, own in rows["particles"].of_topics().items()]
    streams += [_tf(topic, own, ros) for topic, own in rows["transforms"].of_topics().items()]
    streams += [_numbers(topic, own, ros) for topic, own in rows["signals"].of_topics().items()]
    closures = rows["closures"].of_topics()
    missed = [
        NotAsRecorded(topic, len(own), "closures of a graph: only their ends were kept")
        for topic, own in closures.items()
    ]
    return Encoded(streams, missed)


def pose_stream(
    topic: str, rows: Rows, ros: Composer, *, with_covariance: bool | None = None
) -> Stream:
    """PoseWithCovarianceStamped where any row has a covariance (or always), else PoseStamped."""
    t, stamps = rows.table, header_stamps(rows.table)
    place, turn = t["position_xyz"].tolist(), t["orientation_xyzw"].tolist()
    covariance = t["covariance"]
    if with_covariance is None:
        with_covariance = not np.isnan(covariance).all()

    def bare(i: int) -> Any:
        return ros.make(
            "geometry_msgs/PoseStamped",
            header=ros.header(stamps[i], t["frame_id"][i]),
            pose=ros.pose_of(place[i], turn[i]),
        )

    if not with_covariance:
        return Stream(topic, "geometry_msgs/PoseStamped", rows.t_log_ns, bare)
    covariance = given(covariance)

    def message(i: int) -> Any:
        return ros.make(
            "geometry_msgs/PoseWithCovarianceStamped",
            header=ros.header(stamps[i], t["frame_id"][i]),
            pose=ros.pose_with_covariance_of(place[i], turn[i], covariance[i]),
        )

    return Stream(topic, "geometry_msgs/PoseWithCovarianceStamped", rows.t_log_ns, message)


def _particles(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)
    weighted = len(t["weights"].values) > 0
    kind = "nav2_msgs/ParticleCloud" if weighted else "geometry_msgs/PoseArray"

    def message(i: int) -> Any:
        poses = ros.planar(t["xyyaw"][i].reshape(-1, 3))
        header = ros.header(stamps[i], t["frame_id"][i])
        if not weighted:
            return ros.make(kind, header=header, poses=poses)
        weights = t["weights"][i].tolist() or [0.0] * len(poses)
        particles = [
            ros.make("nav2_msgs/Particle", pose=pose, weight=weight)
            for pose, weight in zip(poses, weights, strict=True)
        ]
        return ros.make(kind, header=header, particles=particles)

    return Stream(topic, kind, rows.t_log_ns, message)


def _tf(topic: str, rows: Rows, ros: Composer) -> Stream:
    """Edges of one moment make one message."""
    t, stamps = rows.table, header_stamps(rows.table)
    place, turn = t["translation_xyz"].tolist(), t["rotation_xyzw"].tolist()
    found = groups(rows.t_log_ns)

    def edge(row: int) -> Any:
        return ros.make(
            "geometry_msgs/TransformStamped",
            header=ros.header(stamps[row], t["parent_frame"][row]),
            child_frame_id=t["child_frame"][row],
            transform=ros.make(
                "geometry_msgs/Transform",
                translation=ros.vector_of(place[row]),
                rotation=ros.make(
                    "geometry_msgs/Quaternion", **dict(zip("xyzw", turn[row], strict=True))
                ),
            ),
        )

    def message(i: int) -> Any:
        return ros.make("tf2_msgs/TFMessage", transforms=[edge(row) for row in found[i].tolist()])

    t_log_ns = rows.t_log_ns[[g[0] for g in found]]
    latched = topic.endswith("tf_static")
    return Stream(topic, "tf2_msgs/TFMessage", t_log_ns, message, latched)


def _numbers(topic: str, rows: Rows, ros: Composer) -> Stream:
    """A plain number, one with a stamp, or the numbers of als_ros, which come as a vector."""
    t, stamps = rows.table, header_stamps(rows.table)
    value = t["value"].tolist()
    names = set(t["name"].tolist())
    if names != {topic.rpartition("/")[2]} or topic.rpartition("/")[2].lower() in _VECTORS:
        found = groups(rows.t_log_ns, stamps)

        def vector(i: int) -> Any:
            xyz = [*(value[row] for row in found[i].tolist()), 0.0, 0.0, 0.0][:3]
            return ros.make(
                "geometry_msgs/Vector3Stamped",
                header=ros.header(stamps[found[i][0]], ""),
                vector=ros.vector_of(xyz),
            )

        t_log_ns = rows.t_log_ns[[g[0] for g in found]]
        return Stream(topic, "geometry_msgs/Vector3Stamped", t_log_ns, vector)
    if (t["t_sensor_ns"] == NO_STAMP).all():
        return Stream(
            topic, "std_msgs/Float64", rows.t_log_ns,
            lambda i: ros.make("std_msgs/Float64", data=value[i]),
        )  # fmt: skip
    kind = "autoware_internal_debug_msgs/Float32Stamped"
    return Stream(
        topic, kind, rows.t_log_ns,
        lambda i: ros.make(kind, stamp=ros.stamp(stamps[i]), data=value[i]),
    )  # fmt: skip
