"""geometry_msgs/PoseArray and nav2_msgs/ParticleCloud."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se3
from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.checks import pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages, children: str, path: str, *, weighted: bool) -> Decoded:
    return cloud_rows(
        messages, children, path, messages.frames(), messages.stamps(), weighted=weighted
    )


def cloud_rows(
    messages: Messages,
    children: str,
    path: str,
    frames: NDArray[Any],
    t_sensor_ns: Times,
    *,
    weighted: bool,
) -> Decoded:
    """Rows of table particles, one a message.

    Args:
        messages: N messages.
        children: name of their sequence of particles.
        path: from a particle to its pose's fields, with its last dot.
        frames: (N,) the frame of each cloud.
        t_sensor_ns: (N,) stamps.
        weighted: whether particles have a weight.
    """
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
        "frame_id": frames,
        "xyyaw": Ragged(xyyaw.ravel(), 3 * offsets),
        "weights": weights,
    }
    named = tuple(Remark(r.kind, r.count, f"particles: {r.reason}") for r in remarks)
    return Decoded(columns, messages.every, t_sensor_ns, named)


def _pose_array(messages: Messages) -> Decoded:
    return _decode(messages, "poses", "", weighted=False)


def _particle_cloud(messages: Messages) -> Decoded:
    return _decode(messages, "particles", "pose.", weighted=True)


POSE_ARRAY = Decoder("particles", _pose_array)
PARTICLE_CLOUD = Decoder("particles", _particle_cloud)
