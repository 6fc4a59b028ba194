"""foxglove.PointCloud: x y z of the points that are finite, moved by the cloud's own pose.

Of x, y and z two are enough; the third is 0 then. Source: docs.foxglove.dev, schemas, PointCloud.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se3
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.foxglove import turned
from slamreplay.ingest.decoders.packed import PackedField, packed_fields, unpacked

_Points = NDArray[np.float32]
_NONE: _Points = np.empty((0, 3), dtype=np.float32)


def _decode(messages: Messages) -> Decoded:
    rotation, _ = turned(messages, "pose.orientation")
    T = se3.matrix(messages.columns("pose.position", "xyz"), rotation)
    placed = np.asarray(np.isfinite(T).all(axis=(1, 2)))
    strides = messages.column("point_stride", np.int64).tolist()
    data, fields = messages.ragged("data", np.uint8), packed_fields(messages)
    clouds: list[_Points] = []
    readable = np.ones(len(messages), dtype=bool)
    for row, stride in enumerate(strides):
        xyz = _points(data[row], fields[row], stride)
        readable[row] = xyz is not None
        clouds.append(_NONE if xyz is None or not placed[row] else _moved(xyz, T[row]))
    columns = {
        "frame_id": messages.frames("frame_id"),
        "points_xyz": Ragged.of(clouds, np.float32),
    }
    remarks = (
        Remark("lost", int((~readable).sum()), "no x y z fields, or fewer bytes than said"),
        Remark("lost", int((readable & ~placed).sum()), "the cloud's pose is not finite"),
    )
    stamps = messages.stamps("timestamp")
    return kept(readable & placed, columns, messages.every, stamps, remarks)


def _points(
    data: NDArray[np.uint8], fields: list[PackedField], stride: int
) -> NDArray[np.float64] | None:
    """(M, 3) all points as they are packed, None where the bytes do not hold them."""
    named = {field.name: field for field in fields}
    axes = [named.get(axis) for axis in "xyz"]
    if axes.count(None) > 1 or stride <= 0 or len(data) % stride:
        return None
    count = len(data) // stride
    columns = []
    for field in axes:
        column = np.zeros(count) if field is None else unpacked(data, field, (count,), (stride,))
        if column is None:
            return None
        columns.append(column.astype(np.float64))
    return np.column_stack(columns)


def _moved(xyz: NDArray[np.float64], T_frame_cloud: NDArray[np.float64]) -> _Points:
    """The finite points (M, 3) in the cloud's frame; those of an unmoved cloud to the last bit."""
    with np.errstate(over="ignore", invalid="ignore"):
        if not np.array_equal(T_frame_cloud, np.eye(4)):
            xyz = xyz @ T_frame_cloud[:3, :3].T + T_frame_cloud[:3, 3]
        points = xyz.astype(np.float32)
    return np.asarray(points[np.isfinite(points).all(axis=1)])


POINT_CLOUD = Decoder("points", _decode)
