"""Tags that a detector puts on tf: camera -> tag, once for each time it saw one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slamreplay.ingest.names import basename, is_map_frame, is_odom_frame, tokens
from slamreplay.ingest.rows import TopicRows

_TAG = frozenset({"tag", "apriltag", "aruco", "marker", "fiducial", "fid"})
#: apriltag_ros of ROS 2 names tags by their family alone where the user names them not: "36h11:0".
_FAMILY = re.compile(r"[a-z]*\d+h\d+:\d+")


def is_tag_frame(frame: str) -> bool:
    """Whether a frame is called like a numbered tag: "tag_3", "36h11:3", "fiducial_12"."""
    words = tokens(basename(frame))
    if _FAMILY.fullmatch(basename(frame)):
        return True
    return len(words) > 1 and words[0] in _TAG and words[-1].isdigit()


def tag_sightings(tf: Sequence[TopicRows]) -> list[TopicRows]:
    """Rows of table references, kind fiducial: the tag in the camera, as often as it was seen.

    A tag that is fixed in the map or to another tag is a survey of where tags are, no sighting.
    """
    found = []
    for topic in tf:
        parents, children = topic.columns["parent_frame"], topic.columns["child_frame"]
        tags = [name for name in set(children) if is_tag_frame(name)]
        fixed = [name for name in set(parents) if _is_fixed(name)]
        seen = np.isin(children, tags) & ~np.isin(parents, fixed) & ~topic.columns["is_static"]
        rows = topic.take(np.flatnonzero(seen))
        if not len(rows):
            continue
        columns = {
            "frame_id": rows.columns["parent_frame"],
            "child_frame_id": rows.columns["child_frame"],
            "kind": np.full(len(rows), "fiducial", dtype=object),
            "position_xyz": rows.columns["translation_xyz"],
            "orientation_xyzw": rows.columns["rotation_xyzw"],
            "covariance": np.full((len(rows), 36), np.nan),
        }
        found.append(replace(rows, table="references", columns=columns, messages=len(rows)))
    return found


def _is_fixed(frame: str) -> bool:
    return is_map_frame(frame) or is_odom_frame(frame) or is_tag_frame(frame)
