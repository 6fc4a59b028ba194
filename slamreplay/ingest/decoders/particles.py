"""geometry_msgs/PoseArray and nav2_msgs/ParticleCloud."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se3
from slamreplay.ingest.decoders.checks import pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages, children: str, path: str, *, weighted: bool) -> Decoded:
    particles, rows = messages.children(children)
    position = particles.columns(f"{path}position", "xyz")
    unit, keep, remarks = pose_rows(position, particles.columns(f"{path}orientation", "xyzw"))
    xyyaw = np.column_stack([position[:, :2], se3.yaw_from_quaternion(unit)])[keep]
    counts = np.bincount(rows[keep], minlength=len(messages))
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    weights = Ragged(np.empty(0), np.zeros(len(messages) + 1, dtype=np.int64))
    if weighted:
        weights = Ragged(particles.column("weight")[keep], offsets)
    columns = {
        "frame_id": messages.frames(),
        "xyyaw": Ragged(xyyaw.ravel(), 3 * offsets),
        "weights": weights,
    }
    named = tuple(Remark(r.kind, r.count, f"particles: {r.reason}") for r in remarks)
    return Decoded(columns, messages.every, messages.stamps(), named)


def _pose_array(messages: Messages) -> Decoded:
    return _decode(messages, "poses", "", weighted=False)


def _particle_cloud(messages: Messages) -> Decoded:
    return _decode(messages, "particles", "pose.", weighted=True)


POSE_ARRAY = Decoder("particles", _pose_array)
PARTICLE_CLOUD = Decoder("particles", _particle_cloud)
