"""What a message type looks like on the wire: a tree of numbers, texts, structs and repetitions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

#: Names of primitive types in message definitions to numpy's, without a byte order.
_NUMBERS = {
    "bool": "b1",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
_DEEPEST = 32
#: What rosidl puts into a type without fields, which C and IDL do not know.
_NOTHING = "structure_needs_at_least_one_member"


class UnknownLayoutError(ValueError):
    """The definition holds something that cannot be read as columns (wide strings, cycles)."""


@dataclass(frozen=True)
class Number:
    """A primitive; `dtype` without a byte order, "f8"."""

    dtype: str

    @property
    def size(self) -> int:
        """Bytes, which on the wire of CDR are its alignment too."""
        return int(self.dtype[1])


@dataclass(frozen=True)
class Text:
    """A string with its length before it."""


@dataclass(frozen=True)
class Repeated:
    """An array of `count` elements, or where that is None a sequence with its length before it."""

    element: Node
    count: int | None


@dataclass(frozen=True)
class Struct:
    """Fields by name, in the order of the wire."""

    fields: Mapping[str, Node]


Node = Number | Text | Repeated | Struct


def layout_of(
    name: str, definitions: Mapping[str, Any], encoding: str = "cdr", *, depth: int = 0
) -> Struct:
    """The layout of a type.

    Args:
        name: normalised type name.
        definitions: type name to (constants, fields), as rosbags' type stores hold them.
        encoding: "ros1", where a type without fields has no bytes, or "cdr", where it has one.
        depth: of the type in the one that was asked for.

    Raises:
        UnknownLayoutError: a type is not defined, holds itself, or a primitive is not known here.
    """
    if depth > _DEEPEST:
        raise UnknownLayoutError(f"{name} holds itself")
    if name not in definitions:
        raise UnknownLayoutError(f"{name} is not defined")
    fields = [field for field in definitions[name][1] if field[0] != _NOTHING]
    if not fields and encoding == "cdr":
        return Struct({_NOTHING: Number("u1")})
    return Struct({field: _node(spec, definitions, encoding, depth) for field, spec in fields})


def _node(spec: Any, definitions: Mapping[str, Any], encoding: str, depth: int) -> Node:
    from rosbags.interfaces import Nodetype

    kind, args = spec
    if kind == Nodetype.NAME:
        return layout_of(args, definitions, encoding, depth=depth + 1)
    if kind == Nodetype.BASE:
        if args[0] == "string":
            return Text()
        if args[0] not in _NUMBERS:
            raise UnknownLayoutError(f"a field is a {args[0]}")
        return Number(_NUMBERS[args[0]])
    element, count = args
    node = _node(element, definitions, encoding, depth)
    return Repeated(node, count if kind == Nodetype.ARRAY else None)


def is_fixed(node: Node) -> bool:
    """Whether every value of the type takes the same number of bytes, alignment apart."""
    if isinstance(node, Struct):
        return all(is_fixed(field) for field in node.fields.values())
    if isinstance(node, Repeated):
        return node.count is not None and is_fixed(node.element)
    return isinstance(node, Number)


def least_size(node: Node) -> int:
    """Bytes that the shortest value takes, alignment apart: a bound on how many can be there."""
    if isinstance(node, Number):
        return node.size
    if isinstance(node, Struct):
        return sum(least_size(field) for field in node.fields.values())
    if isinstance(node, Repeated) and node.count is not None:
        return node.count * least_size(node.element)
    return 4


def widest(node: Node) -> int:
    """The largest primitive of a fixed type, in bytes."""
    if isinstance(node, Struct):
        return max((widest(field) for field in node.fields.values()), default=1)
    if isinstance(node, Repeated):
        return widest(node.element)
    return node.size if isinstance(node, Number) else 4


def offsets(node: Node, phase: int, most: int) -> tuple[list[int], int]:
    """Where the numbers of a fixed type are, and its size, if it starts at `phase` (mod 8).

    Args:
        node: a fixed type.
        phase: of its first byte from the origin of alignment.
        most: the largest alignment there is: 1 for ROS 1, 8 for CDR, 4 for XCDR2.
    """
    if isinstance(node, Number):
        pad = -phase % min(node.size, most)
        return [pad], pad + node.size
    if isinstance(node, Struct):
        parts = list(node.fields.values())
    elif isinstance(node, Repeated) and node.count is not None:
        if isinstance(node.element, Number):  # a run of numbers is one place
            pad = -phase % min(node.element.size, most)
            return [pad], pad + node.count * node.element.size
        parts = [node.element] * node.count
    else:
        raise UnknownLayoutError("not of a fixed size")
    found, size = [], 0
    for part in parts:
        inner, grown = offsets(part, (phase + size) % 8, most)
        found += [size + at for at in inner]
        size += grown
    return found, size
