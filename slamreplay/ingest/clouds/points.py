"""Clouds of message types that are read as bare points: ROS 1's PointCloud, Foxglove's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slamreplay.ingest import DECODERS
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.decoders.decoder import Messages


def clouds_of_points(kind: str) -> Callable[[Messages], Clouds]:
    """A reader of clouds from the points that the decoder of a message type gives.

    Their points carry no time, and a ray that came back from nowhere leaves no trace.
    """

    def read(messages: Messages) -> Clouds:
        decoded = DECODERS.load(kind).decode(messages)
        points, rows = decoded.columns["points_xyz"], decoded.rows
        return Clouds(
            xyz=np.ascontiguousarray(points.values.reshape(-1, 3).T, dtype=np.float32),
            time=None,
            offsets=points.offsets // 3,
            rows=np.ones(len(rows), dtype=np.int64),
            frame_id=decoded.columns["frame_id"],
            t_sensor_ns=decoded.t_sensor_ns,
            t_log_ns=messages.t_log_ns[rows],
            index=rows,
            lost=sum(r.count for r in decoded.remarks if r.kind == "lost"),
        )

    return read
