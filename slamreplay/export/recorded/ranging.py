"""What the robot saw: laser scans with their ranges bit for bit, and thinned point clouds.

Intensities are not kept by any bundle, so there are none.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from slamreplay.export.formats import NotAsRecorded
from slamreplay.export.recorded.selection import Rows
from slamreplay.export.recorded.stream import Composer, Encoded, Stream, header_stamps

_FLOAT32 = 7  # sensor_msgs/PointField
#: Types whose scans were made of something else on the way into the bundle.
_MADE_OF = {
    "PointCloud2": "a cloud flattened to a scan: its points were not kept",
    "PointCloud": "a cloud flattened to a scan: its points were not kept",
    "MultiEchoLaserScan": "several echoes a beam: one of them was kept",
}


def ranging(rows: Mapping[str, Rows], types: Mapping[str, str], ros: Composer) -> Encoded:
    """Streams of the tables scans and points.

    Args:
        rows: of the tables.
        types: the message type of topics where it is known.
        ros: makes messages.
    """
    clouds = rows["points"].of_topics()
    streams, missed = [], []
    for topic, own in rows["scans"].of_topics().items():
        kind = types.get(topic, "").rpartition("/")[2]
        name = f"{topic}/scan" if topic in clouds else topic
        if kind in _MADE_OF:
            missed.append(NotAsRecorded(topic, len(own), _MADE_OF[kind]))
        streams.append(_scans(name, own, ros))
    streams += [_points(topic, own, ros) for topic, own in clouds.items()]
    return Encoded(streams, missed)


def _scans(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)
    fields = {
        "angle_min": "angle_min_rad",
        "angle_increment": "angle_increment_rad",
        "time_increment": "time_increment_s",
        "scan_time": "scan_time_s",
        "range_min": "range_min_m",
        "range_max": "range_max_m",
    }
    numbers = {name: t[column].tolist() for name, column in fields.items()}
    none = np.empty(0, dtype=np.float32)

    def message(i: int) -> Any:
        ranges = t["ranges_m"][i]
        own = {name: column[i] for name, column in numbers.items()}
        last = own["angle_min"] + own["angle_increment"] * max(len(ranges) - 1, 0)
        return ros.make(
            "sensor_msgs/LaserScan",
            header=ros.header(stamps[i], t["frame_id"][i]),
            angle_max=last,
            ranges=ranges,
            intensities=none,
            **own,
        )

    return Stream(topic, "sensor_msgs/LaserScan", rows.t_log_ns, message)


def _points(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)
    fields = [
        ros.make("sensor_msgs/PointField", name=name, offset=4 * k, datatype=_FLOAT32, count=1)
        for k, name in enumerate("xyz")
    ]

    def message(i: int) -> Any:
        data = np.frombuffer(t["points_xyz"][i].astype("<f4").tobytes(), dtype=np.uint8)
        return ros.make(
            "sensor_msgs/PointCloud2",
            header=ros.header(stamps[i], t["frame_id"][i]),
            height=1,
            width=len(data) // 12,
            fields=fields,
            is_bigendian=False,
            point_step=12,
            row_step=len(data),
            data=data,
            is_dense=True,
        )

    return Stream(topic, "sensor_msgs/PointCloud2", rows.t_log_ns, message)
