"""tf2_msgs/TFMessage and its elder, tf/tfMessage; which edges are static is settled later."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages) -> Decoded:
    edges, rows = messages.children("transforms")
    pose = (edges.columns("transform.translation", "xyz"),
            edges.columns("transform.rotation", "xyzw"))  # fmt: skip
    return edge_rows(edges.frames(), edges.frames("child_frame_id"), *pose, rows, edges.stamps())


def edge_rows(
    parents: NDArray[Any],
    children: NDArray[Any],
    translation_xyz: NDArray[np.float64],
    rotation_xyzw: NDArray[np.float64],
    rows: NDArray[np.int64],
    t_sensor_ns: Times,
) -> Decoded:
    """Rows of table transforms from N edges; those without sound frames or rotation are counted.

    Args:
        parents: (N,) names of the parent frames.
        children: (N,) names of the child frames.
        translation_xyz: (N, 3) the child's origin in the parent, m.
        rotation_xyzw: (N, 4) the child's axes in the parent.
        rows: (N,) index of the message each edge came from.
        t_sensor_ns: (N,) stamps.
    """
    rotation, keep, remarks = pose_rows(translation_xyz, rotation_xyzw)
    named = (parents != children) & (parents != "") & (children != "")
    columns = {
        "parent_frame": parents,
        "child_frame": children,
        "is_static": np.zeros(len(parents), dtype=bool),
        "translation_xyz": translation_xyz,
        "rotation_xyzw": rotation,
    }
    unnamed = Remark("lost", int((~named).sum()), "a frame without a name, or its own parent")
    return kept(keep & named, columns, rows, t_sensor_ns, (*remarks, unnamed))


TRANSFORMS = Decoder("transforms", _decode)
