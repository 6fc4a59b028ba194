"""A reference in a frame of its own that the user knows the place of.

A simulator's world or a tracking system's room is seldom tied to the map by tf. Laying it onto the
belief would eat the very error that it is to judge; who knows the transform says it in the topics
file: `reference_in_map: [x, y, yaw]`, metres and degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.bundle.schema import JUDGING_KINDS
from slamreplay.errors import UsageError
from slamreplay.geometry import se3
from slamreplay.geometry.covariance import ros_turned
from slamreplay.geometry.se2 import transform_points
from slamreplay.ingest.rows import TopicRows

#: Key of the topics file: where the reference's frame lies in the map, m, m and degrees.
PLACE_KEY = "reference_in_map"


def checked_place(value: object, path: Path) -> str:
    """Three numbers, as text.

    Raises:
        UsageError: anything else.
    """
    numbers = value if isinstance(value, list) else []
    sound = len(numbers) == 3 and all(type(n) in (int, float) for n in numbers)
    if not sound or not np.isfinite(numbers).all():
        raise UsageError(
            f"'{PLACE_KEY}' takes x and y in m and the heading in degrees",
            where=path,
            hint="as in [15.0, 15.0, 0.0]",
        )
    return " ".join(repr(float(n)) for n in numbers)


def placed_reference(
    topic: TopicRows, overrides: Mapping[str, str], map_frame: str
) -> tuple[TopicRows, list[Loss]]:
    """A judging reference's rows in the map, and a word on it; any other rows as they are."""
    if PLACE_KEY not in overrides or topic.table != "references" or not len(topic):
        return topic, []
    if not {str(kind) for kind in topic.columns["kind"]} <= JUDGING_KINDS:
        return topic, []
    x, y, yaw_deg = (float(n) for n in overrides[PLACE_KEY].split())
    pose = np.array([x, y, np.radians(yaw_deg)])
    position = np.array(topic.columns["position_xyz"], dtype=np.float64)
    position[:, :2] = transform_points(pose, position[:, :2])
    R = se3.from_planar(pose)[:3, :3]
    columns = {
        **topic.columns,
        "frame_id": np.full(len(topic), map_frame, dtype=object),
        "position_xyz": position,
        "orientation_xyzw": se3.yawed(topic.columns["orientation_xyzw"], float(pose[2])),
        "covariance": ros_turned(topic.columns["covariance"], R).reshape(-1, 36),
    }
    frame = str(topic.columns["frame_id"][0])
    reason = f"'{frame}' lies at {x:g} m, {y:g} m, {yaw_deg:g} deg in the map by the topics file"
    told = Loss(kind="repaired", what=f"poses of {topic.topic}", count=len(topic), reason=reason)
    return replace(topic, columns=columns), [told]
