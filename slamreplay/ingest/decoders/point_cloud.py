"""sensor_msgs/PointCloud2: x y z of the points that are finite."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: sensor_msgs/PointField datatypes.
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def _decode(messages: Messages) -> Decoded:
    clouds, readable = [], np.ones(len(messages), dtype=bool)
    for row, message in enumerate(messages):
        xyz = _points(message)
        readable[row] = xyz is not None
        clouds.append(np.empty((0, 3), dtype=np.float32) if xyz is None else xyz)
    columns = {"frame_id": messages.frames(), "points_xyz": Ragged.of(clouds, np.float32)}
    remarks = (Remark("lost", int((~readable).sum()), "no x y z fields, or fewer bytes than said"),)
    return kept(readable, columns, messages.every, messages.stamps(), remarks)


def _points(message: Any) -> NDArray[np.float32] | None:
    fields = {f.name: f for f in message.fields}
    if not {"x", "y", "z"} <= set(fields):
        return None
    order = ">" if message.is_bigendian else "<"
    try:
        layout = np.dtype(
            {
                "names": ["x", "y", "z"],
                "formats": [order + _DTYPES[fields[n].datatype] for n in "xyz"],
                "offsets": [fields[n].offset for n in "xyz"],
                "itemsize": message.point_step,
            }
        )
        cells = np.ndarray(
            (message.height, message.width),
            layout,
            np.ascontiguousarray(message.data, dtype=np.uint8),
            strides=(message.row_step, message.point_step),
        ).ravel()
    except (KeyError, TypeError, ValueError):
        return None
    xyz = np.column_stack([cells[n].astype(np.float32) for n in "xyz"])
    return np.asarray(xyz[np.isfinite(xyz).all(axis=1)])


POINT_CLOUD = Decoder("points", _decode)
