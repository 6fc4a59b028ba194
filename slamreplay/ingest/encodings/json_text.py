"""JSON messages: Foxglove's schemas, and ROS types as bridges write them.

Every field is read as the definition says. One that is missing, or null, has its default, which is
counted when a decoder asks for it; one of another kind breaks its message. What writers do in
different ways is read in all of them: bytes as base64 or as a list; times as {sec, nsec}, ROS 2's
{sec, nanosec} and ROS 1's {secs, nsecs}; enums as number or name; numbers that JSON does not have
as null or "NaN", as "Infinity" and "-Infinity"; typed arrays of JavaScript, which JSON.stringify
turns into {"0": ..., "1": ...}. A null among numbers is NaN: what it stood for is not known.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections import Counter
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from slamreplay.ingest.encodings.definition import (
    BrokenMessageError,
    Many,
    Node,
    Number,
    Struct,
    Time,
    array,
    default,
    number,
    time,
)

_SECONDS = ("sec", "secs", "seconds")
_NANOSECONDS = ("nsec", "nanosec", "nsecs", "nanos", "nanoseconds")

Read = Callable[[Any], Any]


class JsonMessages:
    """Payloads to objects with the fields of a definition; see `Deserialiser`."""

    def __init__(self, struct: Struct) -> None:
        self.missing: Counter[str] = Counter()
        self._read = _struct(struct, "", self.missing)

    def __call__(self, data: bytes) -> Any:
        """The message in a payload.

        Raises:
            ValueError: not JSON, no object, or a field of another kind.
        """
        try:
            value = json.loads(data)
        except RecursionError as error:
            raise BrokenMessageError("JSON that is nested too deeply") from error
        return self._read(value)


def _struct(struct: Struct, path: str, missing: Counter[str]) -> Read:
    paths = {name: f"{path}.{name}" if path else name for name in struct.fields}
    reads = {name: _node(node, paths[name], missing) for name, node in struct.fields.items()}
    # A null is a missing field, but for a lone float: there it is a number that JSON lacks.
    nullable = {
        n for n, f in struct.fields.items() if isinstance(f, Number) and f.dtype.kind == "f"
    }

    class Fields(SimpleNamespace):
        """The fields a message has, and on demand those that it does not have."""

        def __getattr__(self, name: str) -> Any:
            if name not in paths:
                raise AttributeError(f"there is no field '{name}' in this type")
            missing[paths[name]] += 1
            value = default(struct.fields[name])
            setattr(self, name, value)
            return value

    def read(value: Any) -> Any:
        if not isinstance(value, dict):
            raise BrokenMessageError(f"{path or 'the message'} is no JSON object")
        fields = Fields()
        for name, one in reads.items():
            if name in value and (value[name] is not None or name in nullable):
                setattr(fields, name, one(value[name]))
        return fields

    return read


def _node(node: Node, path: str, missing: Counter[str]) -> Read:
    if isinstance(node, Struct):
        return _struct(node, path, missing)
    if isinstance(node, Many) and not isinstance(node.element, Number):
        one = _node(node.element, f"{path}[]", missing)
        return lambda value: _elements(value, node, one, path)
    read: Read
    match node:
        case Number():
            read = lambda value: _number(value, node)  # noqa: E731
        case Many(element=Number(dtype=dtype)):
            read = lambda value: _numbers(value, node, dtype)  # noqa: E731
        case Time():
            read = lambda value: _time(value, path, missing)  # noqa: E731
        case _:
            read = _text

    def with_path(value: Any) -> Any:
        try:
            return read(value)
        except ValueError as error:
            raise BrokenMessageError(f"{path}: {error}") from error

    return with_path


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise BrokenMessageError("no text")
    value.encode()  # half a surrogate pair, which JSON may escape, is a ValueError here
    return value


def _number(value: Any, node: Number) -> Any:
    if value is None:
        return float("nan")
    if isinstance(value, str) and value in node.names:
        return node.names[value]
    return number(value, node.dtype)


def _time(value: Any, path: str, missing: Counter[str]) -> SimpleNamespace:
    if not isinstance(value, dict):
        raise BrokenMessageError("no time of seconds and nanoseconds")
    parts = []
    for names in (_SECONDS, _NANOSECONDS):
        found = [value[name] for name in names if value.get(name) is not None]
        if not found:
            missing[f"{path}.{names[0]}"] += 1
        parts.append(number(found[0], np.dtype(np.int64)) if found else 0)
    return time(*parts)


def _numbers(value: Any, many: Many, dtype: np.dtype[Any]) -> Any:
    if isinstance(value, str) and dtype.itemsize == 1:
        try:
            value = np.frombuffer(base64.b64decode(value, validate=True), dtype=dtype)
        except (ValueError, binascii.Error) as error:
            raise BrokenMessageError("no base64") from error
        return value if many.count is None else array(value, many, dtype)
    if isinstance(value, Mapping):
        value = [value.get(str(index)) for index in range(len(value))]
    if not isinstance(value, list):
        raise BrokenMessageError("no list of numbers")
    return array(value, many, dtype)


def _elements(value: Any, many: Many, one: Read, path: str) -> list[Any]:
    if not isinstance(value, list):
        raise BrokenMessageError(f"{path} is no list")
    if many.count is not None and len(value) != many.count:
        raise BrokenMessageError(f"{path} has {len(value)} entries, not {many.count}")
    return [one(element) for element in value]
