"""nav_msgs/Path."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se3
from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.checks import pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages) -> Decoded:
    return path_rows(messages, "pose.", messages.frames(), messages.stamps())


def path_rows(messages: Messages, path: str, frames: NDArray[Any], t_sensor_ns: Times) -> Decoded:
    """Rows of table plans, one a message with a sequence `poses`.

    Args:
        messages: N messages.
        path: from a way point to its pose's fields, with its last dot.
        frames: (N,) the frame of each path.
        t_sensor_ns: (N,) stamps.
    """
    poses, rows = messages.children("poses")
    position = poses.columns(f"{path}position", "xyz")
    # Planners may leave the orientation of way points empty; the place still counts.
    raw = poses.columns(f"{path}orientation", "xyzw")
    raw[(raw == 0.0).all(axis=1)] = (0.0, 0.0, 0.0, 1.0)
    unit, keep, remarks = pose_rows(position, raw)
    xyyaw = np.column_stack([position[:, :2], se3.yaw_from_quaternion(unit)])[keep]
    counts = np.bincount(rows[keep], minlength=len(messages))
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    columns = {"frame_id": frames, "xyyaw": Ragged(xyyaw.ravel(), 3 * offsets)}
    named = tuple(Remark(r.kind, r.count, f"way points: {r.reason}") for r in remarks)
    return Decoded(columns, messages.every, t_sensor_ns, named)


PATH = Decoder("plans", _decode)
