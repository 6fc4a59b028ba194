"""Message types of our own, for what no schema of Foxglove holds: numbers, states, the verdict.

They are protobuf like the rest, so that one decoder reads the whole file, and so that an unknown
number can be NaN: JSON has none, and a field that is left out draws a line across the gap.
"""

from __future__ import annotations

from functools import cache

from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import DESCRIPTOR as TIMESTAMP

_PACKAGE = "slamreplay"
_F = FieldDescriptorProto
#: Type to its fields: name, protobuf type, and whether there may be many.
_TYPES: dict[str, tuple[tuple[str, _F.Type.ValueType, bool], ...]] = {
    "Number": (
        ("timestamp", _F.TYPE_MESSAGE, False),
        ("value", _F.TYPE_DOUBLE, False),
        ("unit", _F.TYPE_STRING, False),
    ),
    "State": (
        ("timestamp", _F.TYPE_MESSAGE, False),
        ("state", _F.TYPE_STRING, False),
        ("confidence", _F.TYPE_DOUBLE, False),
        ("max_error_m", _F.TYPE_DOUBLE, False),
        ("max_error_rad", _F.TYPE_DOUBLE, False),
        ("findings", _F.TYPE_STRING, True),
    ),
    "Verdict": (
        ("timestamp", _F.TYPE_MESSAGE, False),
        ("summary", _F.TYPE_STRING, False),
        ("state", _F.TYPE_STRING, False),
        ("confidence", _F.TYPE_DOUBLE, False),
        ("failure_mode", _F.TYPE_STRING, False),
        ("findings", _F.TYPE_STRING, True),
    ),
}


@cache
def message_type(name: str) -> type[Message]:
    """The class of `slamreplay.NAME`; its fields are those listed above, `timestamp` the first."""
    pool = descriptor_pool.Default()  # holds Timestamp already
    if name == next(iter(_TYPES)):
        pool.AddSerializedFile(_file().SerializeToString())
    else:
        message_type(next(iter(_TYPES)))
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{_PACKAGE}.{name}"))


def _file() -> FileDescriptorProto:
    file = FileDescriptorProto(
        name="slamreplay/export.proto",
        package=_PACKAGE,
        syntax="proto3",
        dependency=[TIMESTAMP.name],
    )
    for name, fields in _TYPES.items():
        kind = file.message_type.add(name=name)
        for number, (field, of, is_many) in enumerate(fields, start=1):
            kind.field.add(
                name=field,
                number=number,
                type=of,
                label=_F.LABEL_REPEATED if is_many else _F.LABEL_OPTIONAL,
                type_name=".google.protobuf.Timestamp" if of == _F.TYPE_MESSAGE else None,
            )
    return file
