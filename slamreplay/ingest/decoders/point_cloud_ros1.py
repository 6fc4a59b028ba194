"""sensor_msgs/PointCloud, which ROS 1 had before PointCloud2: the points that are finite."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages


def _decode(messages: Messages) -> Decoded:
    points, rows = messages.children("points")
    xyz = points.columns("", "xyz").astype(np.float32)
    finite = np.isfinite(xyz).all(axis=1)
    counts = np.bincount(rows[finite], minlength=len(messages))
    offsets = np.concatenate([[0], np.cumsum(3 * counts)]).astype(np.int64)
    columns = {"frame_id": messages.frames(), "points_xyz": Ragged(xyz[finite].ravel(), offsets)}
    return Decoded(columns, messages.every, messages.stamps())


POINT_CLOUD_ROS1 = Decoder("points", _decode)
