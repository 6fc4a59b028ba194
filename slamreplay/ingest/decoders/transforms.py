"""tf2_msgs/TFMessage and its elder, tf/tfMessage; which edges are static is settled later."""

from __future__ import annotations

import numpy as np

from slamreplay.ingest.decoders.checks import kept, pose_rows, slashed
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages) -> Decoded:
    edges, rows = messages.children("transforms")
    translation = edges.columns("transform.translation", "xyz")
    rotation, keep, remarks = pose_rows(translation, edges.columns("transform.rotation", "xyzw"))
    parents, children = edges.frames(), edges.frames("child_frame_id")
    named = np.array(
        [p != c and bool(p) and bool(c) for p, c in zip(parents, children, strict=True)], dtype=bool
    )
    columns = {
        "parent_frame": parents,
        "child_frame": children,
        "is_static": np.zeros(len(edges), dtype=bool),
        "translation_xyz": translation,
        "rotation_xyzw": rotation,
    }
    unnamed = Remark("lost", int((~named).sum()), "a frame without a name, or its own parent")
    slashes = slashed(edges.texts("header.frame_id"), edges.texts("child_frame_id"))
    return kept(keep & named, columns, rows, edges.stamps(), (*remarks, unnamed, slashes))


TRANSFORMS = Decoder("transforms", _decode)
