"""What a message type is made of, for encodings that tell fields by name, not by place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from slamreplay.errors import LogError
from slamreplay.ingest.types import shipped

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc

#: Seconds beyond which int64 nanoseconds end.
LARGEST_SEC = 9_000_000_000
_TIMES = {"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"}
_BYTES = {"byte": "uint8", "char": "uint8", "octet": "uint8"}


class BrokenMessageError(ValueError):
    """A payload that is no message of its type."""


@dataclass(frozen=True, eq=False)
class Number:
    """A number, and the names that its type has for some of its values (an enum's)."""

    dtype: np.dtype[Any]
    names: Mapping[str, int]


@dataclass(frozen=True)
class Text:
    """A string."""


@dataclass(frozen=True)
class Time:
    """A time or duration, read as an object with `sec` and `nanosec`."""


@dataclass(frozen=True, eq=False)
class Many:
    """An array of `count` elements, or of any number where that is None."""

    element: Node
    count: int | None


@dataclass(frozen=True, eq=False)
class Struct:
    """Fields by name."""

    fields: Mapping[str, Node]


Node = Number | Text | Time | Many | Struct


@cache
def definition(name: str) -> Struct:
    """The fields of a message type, `package/msg/Type`, of ROS 2, else of ROS 1.

    Raises:
        LogError: there is none of that name.
    """
    for encoding in ("cdr", "ros1"):
        types = shipped(name, encoding)
        if types is not None:
            return _struct(name, types)
    raise LogError("the log has no definition of this type that we can read, and neither do we")


def default(node: Node) -> Any:
    """The value of a field that a message does not have: zero, empty, or full of such."""
    match node:
        case Number(dtype=dtype):
            return dtype.type(0).item()
        case Text():
            return ""
        case Time():
            return SimpleNamespace(sec=0, nanosec=0)
        case Struct(fields=fields):
            return SimpleNamespace(**{name: default(field) for name, field in fields.items()})
        case Many(element=Number(dtype=dtype), count=count):
            return np.zeros(count or 0, dtype=dtype)
        case Many(element=element, count=count):
            return [default(element) for _ in range(count or 0)]


def time(sec: int, nanosec: int) -> SimpleNamespace:
    """The object that a time is read as.

    Raises:
        BrokenMessageError: it lies beyond what int64 nanoseconds hold.
    """
    if not (abs(sec) <= LARGEST_SEC and 0 <= nanosec < 1 << 32):
        raise BrokenMessageError(f"no time: {sec} s and {nanosec} ns")
    return SimpleNamespace(sec=sec, nanosec=nanosec)


def number(value: Any, dtype: np.dtype[Any]) -> Any:
    """A number as Python has it, rounded as `dtype` would be.

    Raises:
        BrokenMessageError: no number, or none of that integer type.
    """
    if not isinstance(value, bool | int | float) and (dtype.kind == "b" or type(value) is not str):
        raise BrokenMessageError("no number")
    try:
        if dtype == np.float64:
            return float(value)
        if dtype.kind not in "iu":
            with np.errstate(over="ignore"):  # what is beyond float32 is infinite there
                return dtype.type(value).item()
        whole = int(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise BrokenMessageError("no number") from error
    fraction = isinstance(value, float) and whole != value
    if fraction or not np.iinfo(dtype).min <= whole <= np.iinfo(dtype).max:
        raise BrokenMessageError(f"{value} is no {dtype}")
    return whole


def array(values: Any, many: Many, dtype: np.dtype[Any]) -> Any:
    """(N,) an array field's numbers as `dtype`; none at all in one of fixed length are zeros.

    Args:
        values: any sequence of numbers; None and texts that say a number ("NaN") count as such.
        many: the field.
        dtype: of its elements.

    Raises:
        BrokenMessageError: not numbers, not as many as there must be, or no such integers.
    """
    try:
        found = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise BrokenMessageError("no list of numbers") from error
    if found.ndim != 1:
        raise BrokenMessageError("no list of numbers")
    if many.count is not None and not len(found):
        return np.zeros(many.count, dtype=dtype)
    if many.count is not None and len(found) != many.count:
        raise BrokenMessageError(f"{len(found)} numbers, not {many.count}")
    if dtype.kind in "iu":
        low, high = np.iinfo(dtype).min, np.iinfo(dtype).max
        # Not a number compares as outside; above 2^53 float64 is not exact.
        inside = (found >= max(low, -(1 << 53))) & (found <= min(high, 1 << 53))
        if not (inside & (found == np.rint(found))).all():
            raise BrokenMessageError(f"numbers that are no {dtype}")
    with np.errstate(over="ignore"):
        return found.astype(dtype, copy=False)


def _struct(name: str, types: Mapping[str, Any]) -> Struct:
    constants, fields = types[name]
    names = {constant: int(v) for constant, _, v in constants if isinstance(v, int | float)}
    return Struct({field: _node(kind, types, names) for field, kind in fields})


def _node(field: FieldDesc, types: Mapping[str, Any], names: Mapping[str, int]) -> Node:
    from rosbags.interfaces import Nodetype

    kind, args = field
    if kind == Nodetype.NAME:
        return Time() if args in _TIMES else _struct(str(args), types)
    if kind == Nodetype.BASE:
        base = str(args[0])
        if base.endswith("string"):
            return Text()
        return Number(np.dtype(_BYTES.get(base, base)), names)
    element, size = cast("tuple[FieldDesc, int]", args)
    return Many(_node(element, types, names), size if kind == Nodetype.ARRAY else None)
