"""The small parts that messages are made of."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import ArrayLike

from slamreplay.evidence.colours import rgb
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.se3 import quaternion_from_yaw
from slamreplay.geometry.times import NS_PER_S

#: A message on its way into the file: time, topic, content.
Sent = tuple[int, str, Message]
Stream = Iterator[Sent]

_TYPE_OF = {
    "f4": PackedElementField.FLOAT32,
    "u1": PackedElementField.UINT8,
    "i1": PackedElementField.INT8,
}


def stamp(t_ns: int) -> Timestamp:
    """A moment."""
    return Timestamp(seconds=t_ns // NS_PER_S, nanos=t_ns % NS_PER_S)


def quaternion(yaw: float) -> Quaternion:
    """A turn about z."""
    x, y, z, w = quaternion_from_yaw(yaw).tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def pose(xyyaw: Array, z_m: float = 0.0) -> Pose:
    """A planar pose (3,), drawn at a height: what is flat would hide each other at one."""
    x, y, yaw = (float(v) for v in xyyaw)
    return Pose(position=Vector3(x=x, y=y, z=z_m), orientation=quaternion(yaw))


def colour(hexadecimal: str, alpha: float = 1.0) -> Color:
    """A colour `#rrggbb`."""
    red, green, blue = (c / 255.0 for c in rgb(hexadecimal))
    return Color(r=red, g=green, b=blue, a=alpha)


def fields(of: np.dtype) -> list[PackedElementField]:
    """What the bytes of one element of a structured array are."""
    assert of.fields is not None
    return [
        PackedElementField(name=name, offset=of.fields[name][1], type=_TYPE_OF[part.str[1:]])
        for name, (part, *_rest) in of.fields.items()
    ]


def line(
    xy: ArrayLike, hexadecimal: str, *, width_px: float, is_loop: bool = False, z_m: float = 0.0
) -> LinePrimitive:
    """A line through points (N, 2), m, as wide on the screen however near one looks."""
    return LinePrimitive(
        type=LinePrimitive.LINE_LOOP if is_loop else LinePrimitive.LINE_STRIP,
        pose=Pose(position=Vector3(z=z_m), orientation=Quaternion(w=1.0)),
        thickness=width_px,
        scale_invariant=True,
        points=[Point3(x=x, y=y) for x, y in np.asarray(xy, dtype=np.float64).tolist()],
        color=colour(hexadecimal),
    )


def text(words: str, xy: Array, hexadecimal: str, *, size_px: float = 14.0) -> TextPrimitive:
    """Words at a point (2,), m, facing the camera."""
    return TextPrimitive(
        pose=pose(np.array([xy[0], xy[1], 0.0]), z_m=0.2),
        billboard=True,
        font_size=size_px,
        scale_invariant=True,
        color=colour(hexadecimal),
        text=words,
    )


def update(*entities: SceneEntity) -> SceneUpdate:
    """All that a topic shows from now on: what it showed before is taken away."""
    everything = SceneEntityDeletion(
        timestamp=entities[0].timestamp if entities else None, type=SceneEntityDeletion.ALL
    )
    return SceneUpdate(deletions=[everything], entities=entities)
