"""Protobuf messages, by the descriptors that their log brings, for a definition that we know.

The descriptors are checked field by field against the definition before a message is read: one
that is broken, or means something else, is refused as a whole. A field that the descriptors lack
has its default, as protobuf itself has it. A message that was cut between two fields is a whole
message to protobuf: the fields behind the cut have their defaults, and decoders judge what is left.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache, partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from slamreplay.errors import LogError
from slamreplay.ingest.encodings.definition import (
    BrokenMessageError,
    Many,
    Node,
    Number,
    Struct,
    Text,
    Time,
    array,
    default,
    number,
    time,
)
from slamreplay.messages.foxglove import SCHEMA_PREFIX, TYPE_PREFIX

if TYPE_CHECKING:
    from google.protobuf.descriptor import Descriptor, FieldDescriptor
    from google.protobuf.message import Message

#: google.protobuf.Timestamp and Duration.
_SECONDS, _NANOS = "seconds", "nanos"

Get = Callable[[Any], Any]


class ProtobufMessages:
    """Payloads to objects with the fields of a definition; see `Deserialiser`.

    Args:
        struct: the definition.
        type_name: normalised name of the type.
        schema: serialised FileDescriptorSet.

    Raises:
        LogError: the descriptors are broken, lack the type, or contradict the definition.
    """

    def __init__(self, struct: Struct, type_name: str, schema: bytes) -> None:
        from google.protobuf.message import DecodeError
        from google.protobuf.message_factory import GetMessageClass

        descriptor = _descriptor(schema, _full_name(type_name))
        self.missing: Counter[str] = Counter()  # what is not there has protobuf's own default
        self._message = GetMessageClass(descriptor)
        self._error = DecodeError
        self._read = _struct(struct, descriptor, "")

    def __call__(self, data: bytes) -> Any:
        """The message in a payload.

        Raises:
            BrokenMessageError: it is no such message.
        """
        message: Message = self._message()
        try:
            message.ParseFromString(data)
        except self._error as error:
            raise BrokenMessageError(f"not a protobuf message of its type ({error})") from error
        return self._read(message)


def _full_name(type_name: str) -> str:
    """The name within the descriptors: "foxglove.LaserScan" of foxglove_msgs/msg/LaserScan."""
    if type_name.startswith(TYPE_PREFIX):
        return SCHEMA_PREFIX + type_name.removeprefix(TYPE_PREFIX)
    return type_name


@cache
def _descriptor(schema: bytes, name: str) -> Descriptor:
    """The message's descriptor, in a pool of its own.

    Raises:
        LogError: a set that is none, whose files contradict each other, or without that message.
    """
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool

    try:
        files = {file.name: file for file in FileDescriptorSet.FromString(schema).file}
        pool = DescriptorPool()
        for file in _in_order(files):
            pool.Add(file)
        return pool.FindMessageTypeByName(name)
    except Exception as error:  # foreign bytes make the library fail in many ways
        reason = str(error).strip("'\"").splitlines() or [type(error).__name__]
        raise LogError(f"its protobuf schema cannot be read: {reason[0]}") from error


def _in_order(files: dict[str, Any]) -> list[Any]:
    """Files of a set, each behind those it imports; our own timestamps where the set has none."""
    from google.protobuf import descriptor_pb2, duration_pb2, timestamp_pb2

    known = dict(files)
    for module in (timestamp_pb2, duration_pb2):
        file = descriptor_pb2.FileDescriptorProto()
        module.DESCRIPTOR.CopyToProto(file)
        known.setdefault(file.name, file)
    order: dict[str, Any] = {}
    todo = list(reversed(files))
    entered = set()
    while todo:
        name = todo[-1]
        imports = [] if name in entered else [d for d in known[name].dependency if d in known]
        entered.add(name)
        imports = [d for d in imports if d not in entered]  # a cycle is left to the pool to refuse
        if imports:
            todo += imports
        else:
            order.setdefault(todo.pop(), known[name])
    return list(order.values())


def _struct(struct: Struct, descriptor: Descriptor, path: str) -> Get:
    """A function from a protobuf message to an object with the fields of the definition."""
    gets: list[tuple[str, Get]] = []
    for name, node in struct.fields.items():
        field = descriptor.fields_by_name.get(name)
        where = f"{path}.{name}" if path else name
        gets.append((name, _absent(node) if field is None else _field(name, node, field, where)))

    def read(message: Any) -> SimpleNamespace:
        return SimpleNamespace(**{name: get(message) for name, get in gets})

    return read


def _absent(node: Node) -> Get:
    return lambda _message: default(node)


def _field(name: str, node: Node, field: FieldDescriptor, where: str) -> Get:
    """A function from a protobuf message to the value of one of its fields.

    Raises:
        LogError: the field is of another kind than the definition says.
    """
    value = _value(node, field, where)
    if value is None:
        raise LogError(f"its protobuf schema has another kind of field at '{where}'")

    def get(message: Any) -> Any:
        try:
            return value(getattr(message, name))
        except ValueError as error:
            raise BrokenMessageError(f"{where}: {error}") from error

    return get


def _value(node: Node, field: FieldDescriptor, where: str) -> Get | None:
    """A function from a field's raw value to what the definition wants, None where it cannot be."""
    if not isinstance(node, Many):
        return None if field.is_repeated else _single(node, field, where)
    if not isinstance(node.element, Number):
        one = _single(node.element, field, where) if field.is_repeated else None
        return None if one is None else partial(_each, one=one)
    dtype = node.element.dtype
    if field.is_repeated:
        is_number = _is_number(field, whole=dtype.kind in "iu")
        return partial(array, many=node, dtype=dtype) if is_number else None
    is_bytes = field.type == field.TYPE_BYTES and dtype.itemsize == 1
    return partial(_bytes, many=node, dtype=dtype) if is_bytes else None


def _single(node: Node, field: FieldDescriptor, where: str) -> Get | None:
    inner = field.message_type
    match node:
        case Number(dtype=dtype):
            is_number = _is_number(field, whole=dtype.kind in "iu")
            return partial(number, dtype=dtype) if is_number else None
        case Text():
            return str if field.type == field.TYPE_STRING else None
        case Time() if inner is not None:
            parts = [inner.fields_by_name.get(name) for name in (_SECONDS, _NANOS)]
            fitting = [p for p in parts if p and not p.is_repeated and _is_number(p, whole=True)]
            return _time if len(fitting) == len(parts) else None
        case Struct() if inner is not None:
            return _struct(node, inner, where)
    return None


def _is_number(field: FieldDescriptor, *, whole: bool) -> bool:
    floats = (field.CPPTYPE_FLOAT, field.CPPTYPE_DOUBLE)
    others = (field.CPPTYPE_MESSAGE, field.CPPTYPE_STRING)
    return field.cpp_type not in others and not (whole and field.cpp_type in floats)


def _bytes(value: bytes, many: Many, dtype: np.dtype[Any]) -> Any:
    found = np.frombuffer(value, dtype=dtype)
    return found if many.count is None else array(found, many, dtype)


def _time(value: Any) -> SimpleNamespace:
    return time(value.seconds, value.nanos)


def _each(values: Any, one: Get) -> list[Any]:
    return [one(value) for value in values]
