"""sensor_msgs/PointCloud2 as points, thinned: enough to look at, little enough to keep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.clouds.fields import Clouds, clouds_of
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: Of the points in a cube of this edge the first is kept, m.
VOXEL_M = 0.1
_REACH = 1 << 13  # cubes to either side: 819 m


def _decode(messages: Messages) -> Decoded:
    clouds = clouds_of(messages)
    first = _first_in_voxel(clouds)
    lengths = np.bincount(clouds.owner[first], minlength=len(clouds))
    offsets = np.concatenate([[0], 3 * np.cumsum(lengths)]).astype(np.int64)
    points = Ragged(np.ascontiguousarray(clouds.xyz[:, first].T).ravel(), offsets)
    columns = {"frame_id": clouds.frame_id, "points_xyz": points}
    remarks = (Remark("lost", clouds.lost, "no x y z fields, or fewer bytes than said"),)
    return Decoded(columns, clouds.index, clouds.t_sensor_ns, remarks)


def _first_in_voxel(clouds: Clouds) -> NDArray[np.int64]:
    """Points to keep, in their order: the first of each cloud in each cube."""
    valid = np.flatnonzero(np.isfinite(clouds.xyz[0]))
    cube = np.floor(np.clip(clouds.xyz[:, valid] / VOXEL_M, -_REACH, _REACH - 1)).astype(np.int64)
    keys = clouds.owner[valid]
    for axis in cube:
        keys = keys * (2 * _REACH) + (axis + _REACH)
    return np.asarray(valid[np.sort(np.unique(keys, return_index=True)[1])])


POINT_CLOUD = Decoder("points", _decode)
