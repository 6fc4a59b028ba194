"""nav_msgs/Path."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se3
from slamreplay.ingest.decoders.checks import pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages) -> Decoded:
    poses, rows = messages.children("poses")
    position = poses.columns("pose.position", "xyz")
    # Planners may leave the orientation of way points empty; the place still counts.
    raw = poses.columns("pose.orientation", "xyzw")
    raw[(raw == 0.0).all(axis=1)] = (0.0, 0.0, 0.0, 1.0)
    unit, keep, remarks = pose_rows(position, raw)
    xyyaw = np.column_stack([position[:, :2], se3.yaw_from_quaternion(unit)])[keep]
    counts = np.bincount(rows[keep], minlength=len(messages))
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    columns = {"frame_id": messages.frames(), "xyyaw": Ragged(xyyaw.ravel(), 3 * offsets)}
    named = tuple(Remark(r.kind, r.count, f"way points: {r.reason}") for r in remarks)
    return Decoded(columns, messages.every, messages.stamps(), named)


PATH = Decoder("plans", _decode)
