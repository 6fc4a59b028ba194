"""sensor_msgs/PointCloud2: x y z of the points that are finite."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: sensor_msgs/PointField datatypes.
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def _decode(messages: Messages) -> Decoded:
    data = messages.ragged("data", np.uint8)
    fields, rows = messages.children("fields")
    names, kinds = fields.texts("name"), fields.column("datatype", np.int64)
    places = fields.column("offset", np.int64)
    shapes = np.column_stack(
        [messages.column(n, np.int64) for n in ("height", "width", "row_step", "point_step")]
    ).reshape(-1, 4)
    is_big = messages.column("is_bigendian", np.bool_)
    ends = np.searchsorted(rows, np.arange(len(messages) + 1))
    clouds, readable = [], np.ones(len(messages), dtype=bool)
    for row in range(len(messages)):
        own = slice(ends[row], ends[row + 1])
        layout = dict(zip(names[own], zip(kinds[own], places[own], strict=True), strict=True))
        xyz = _points(data[row], layout, shapes[row], ">" if is_big[row] else "<")
        readable[row] = xyz is not None
        clouds.append(np.empty((0, 3), dtype=np.float32) if xyz is None else xyz)
    columns = {"frame_id": messages.frames(), "points_xyz": Ragged.of(clouds, np.float32)}
    remarks = (Remark("lost", int((~readable).sum()), "no x y z fields, or fewer bytes than said"),)
    return kept(readable, columns, messages.every, messages.stamps(), remarks)


def _points(
    data: NDArray[np.uint8],
    layout: dict[str, tuple[int, int]],
    shape: NDArray[np.int64],
    order: str,
) -> NDArray[np.float32] | None:
    """(M, 3) finite points of one cloud; None where its layout does not fit its bytes."""
    if not {"x", "y", "z"} <= set(layout):
        return None
    height, width, row_step, point_step = (int(n) for n in shape)
    try:
        point = np.dtype(
            {
                "names": ["x", "y", "z"],
                "formats": [order + _DTYPES[int(layout[n][0])] for n in "xyz"],
                "offsets": [int(layout[n][1]) for n in "xyz"],
                "itemsize": point_step,
            }
        )
        cells = np.ndarray((height, width), point, data, strides=(row_step, point_step)).ravel()
    except (KeyError, TypeError, ValueError):
        return None
    xyz = np.column_stack([cells[n].astype(np.float32) for n in "xyz"])
    return np.asarray(xyz[np.isfinite(xyz).all(axis=1)])


POINT_CLOUD = Decoder("points", _decode)
