"""Independent ideas of the truth: poses that judge, tags, docks and fixes that were sensed."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from slamreplay.export.formats import NotAsRecorded
from slamreplay.export.recorded.localization import pose_stream
from slamreplay.export.recorded.selection import Rows
from slamreplay.export.recorded.stream import Composer, Encoded, Stream, given, header_stamps
from slamreplay.geometry.geodesy import enu_axes, geodetic_from_earth

_TAG = re.compile(r"tag_(-?\d+)")
#: sensor_msgs/NavSatFix: a fix, and a covariance that is known or not.
_FIXED, _GPS, _KNOWN, _UNKNOWN = 0, 1, 3, 0
#: Where poses of a file that was given with --reference go.
GIVEN = "/ground_truth/pose"


def references(rows: Mapping[str, Rows], tf_topics: Collection[str], ros: Composer) -> Encoded:
    """Streams of the table references; tags that were seen on tf are there already."""
    streams: list[Stream] = []
    missed = [
        NotAsRecorded(topic, len(own), "motions between scans: no message tells them")
        for topic, own in rows["relations"].of_topics().items()
    ]
    for topic, own in rows["references"].of_topics().items():
        kinds = set(own.table["kind"].tolist())
        if topic in tf_topics:
            continue
        if kinds == {"gnss"}:
            streams.append(_fixes(topic, own, ros))
        elif kinds == {"fiducial"}:
            streams += _tags(topic, own, ros, missed)
        elif kinds == {"dock"}:
            streams.append(pose_stream(topic, own, ros))
        else:
            streams.append(_posed(topic, own, ros, missed))
    return Encoded(streams, missed)


def _posed(topic: str, rows: Rows, ros: Composer, missed: list[NotAsRecorded]) -> Stream:
    if not topic.startswith("/"):
        missed.append(
            NotAsRecorded(topic, len(rows), f"a file's kind of reference: told on {GIVEN}")
        )
        return pose_stream(GIVEN, rows, ros, with_covariance=True)
    t = rows.table
    if not (t["child_frame_id"] != "").any():
        return pose_stream(topic, rows, ros)
    stamps, covariance = header_stamps(t), given(t["covariance"])
    place, turn = t["position_xyz"].tolist(), t["orientation_xyzw"].tolist()
    still = ros.twist_with_covariance_of([0.0] * 3, [0.0] * 3, np.zeros(36))

    def message(i: int) -> Any:
        return ros.make(
            "nav_msgs/Odometry",
            header=ros.header(stamps[i], t["frame_id"][i]),
            child_frame_id=t["child_frame_id"][i],
            pose=ros.pose_with_covariance_of(place[i], turn[i], covariance[i]),
            twist=still,
        )

    return Stream(topic, "nav_msgs/Odometry", rows.t_log_ns, message)


def _tags(topic: str, rows: Rows, ros: Composer, missed: list[NotAsRecorded]) -> list[Stream]:
    """apriltag_ros's array, one tag a message: the common type that has pose and covariance."""
    numbers = [_TAG.fullmatch(str(name)) for name in rows.table["child_frame_id"]]
    told = np.array([n is not None for n in numbers], dtype=bool)
    told &= np.isfinite(rows.table["orientation_xyzw"]).all(axis=1)
    if not told.all():
        reason = "sightings without a number or a heading: no message tells them"
        missed.append(NotAsRecorded(topic, int((~told).sum()), reason))
    if not told.any():
        return []
    rows = rows.take(told)
    ids = [int(n[1]) for n, use in zip(numbers, told.tolist(), strict=True) if n and use]
    t, stamps, covariance = rows.table, header_stamps(rows.table), given(rows.table["covariance"])
    place, turn = t["position_xyz"].tolist(), t["orientation_xyzw"].tolist()

    def message(i: int) -> Any:
        header = ros.header(stamps[i], t["frame_id"][i])
        posed = ros.make(
            "geometry_msgs/PoseWithCovarianceStamped",
            header=header,
            pose=ros.pose_with_covariance_of(place[i], turn[i], covariance[i]),
        )
        found = ros.make(
            "apriltag_ros/AprilTagDetection",
            id=np.array([ids[i]], dtype=np.int32),
            size=np.zeros(1),
            pose=posed,
        )
        return ros.make("apriltag_ros/AprilTagDetectionArray", header=header, detections=[found])

    return [Stream(topic, "apriltag_ros/AprilTagDetectionArray", rows.t_log_ns, message)]


def _fixes(topic: str, rows: Rows, ros: Composer) -> Stream:
    """sensor_msgs/NavSatFix: latitude and longitude of places in frame `earth`."""
    t, stamps = rows.table, header_stamps(rows.table)
    places = geodetic_from_earth(t["position_xyz"])
    axes = enu_axes(places[:, 0], places[:, 1])
    covariance = t["covariance"].reshape(-1, 6, 6)[:, :3, :3]
    enu = axes @ covariance @ np.swapaxes(axes, 1, 2)
    known = np.isfinite(enu).all(axis=(1, 2))
    enu = np.where(known[:, None, None], enu, 0.0).reshape(-1, 9)
    numbers = places.tolist()

    def message(i: int) -> Any:
        latitude, longitude, altitude = numbers[i]
        return ros.make(
            "sensor_msgs/NavSatFix",
            header=ros.header(stamps[i], t["child_frame_id"][i]),
            status=ros.make("sensor_msgs/NavSatStatus", status=_FIXED, service=_GPS),
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            position_covariance=enu[i],
            position_covariance_type=_KNOWN if known[i] else _UNKNOWN,
        )

    return Stream(topic, "sensor_msgs/NavSatFix", rows.t_log_ns, message)
