"""Where the fields of many messages are in one buffer, and how they are read from there.

A place is `base + offset`: one position a message, with an offset that all of them share. Reading
goes through views of the buffer that start at every byte (stride 1), so that one fancy index copies
a field of all messages, whatever its alignment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Positions = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class NumberPlace:
    """One number a message; `dtype` with its byte order."""

    base: Positions
    offset: int
    dtype: str

    def take(self, index: Positions) -> NumberPlace:
        """The places of the messages at `index`."""
        return replace(self, base=self.base[index])


@dataclass(frozen=True, eq=False)
class RunPlace:
    """A run of numbers a message; `counts` is an int where all runs are of one length."""

    base: Positions
    offset: int
    dtype: str
    counts: int | Positions

    def take(self, index: Positions) -> RunPlace:
        """The places of the messages at `index`."""
        return replace(self, base=self.base[index], counts=_at(self.counts, index))


@dataclass(frozen=True, eq=False)
class TextPlace:
    """One text a message, `lengths` bytes from its first byte on, without the terminator."""

    base: Positions
    offset: int
    lengths: int | Positions

    def take(self, index: Positions) -> TextPlace:
        """The places of the messages at `index`."""
        return replace(self, base=self.base[index], lengths=_at(self.lengths, index))


@dataclass(frozen=True, eq=False)
class GroupPlace:
    """A struct."""

    fields: Mapping[str, Place]

    def take(self, index: Positions) -> GroupPlace:
        """The places of the messages at `index`."""
        return GroupPlace({name: field.take(index) for name, field in self.fields.items()})


@dataclass(frozen=True, eq=False)
class ManyPlace:
    """Sequences of structs or texts: all elements one after another.

    Attributes:
        counts: (N,) elements of each message.
        element: place of the elements, message by message.
    """

    counts: Positions
    element: Place

    def take(self, index: Positions) -> ManyPlace:
        """The places of the messages at `index`."""
        starts = np.cumsum(self.counts) - self.counts
        counts = self.counts[index]
        first = np.cumsum(counts) - counts
        within = np.arange(int(counts.sum()), dtype=np.int64) - np.repeat(first, counts)
        return ManyPlace(counts, self.element.take(np.repeat(starts[index], counts) + within))


Place = NumberPlace | RunPlace | TextPlace | GroupPlace | ManyPlace


def joined(parts: Sequence[Place], order: Positions) -> Place:
    """Places of several walks as one, then in another order.

    Args:
        parts: of one layout.
        order: (M,) index into the parts one after the other.
    """
    first = parts[0]
    if isinstance(first, GroupPlace):
        return GroupPlace({n: joined([p.fields[n] for p in parts], order)  # type: ignore[union-attr]
                           for n in first.fields})  # fmt: skip
    if isinstance(first, ManyPlace):
        counts = np.concatenate([p.counts for p in parts])  # type: ignore[union-attr]
        inner = [p.element for p in parts]  # type: ignore[union-attr]
        whole = joined(inner, np.arange(int(counts.sum()), dtype=np.int64))
        return ManyPlace(counts, whole).take(order)
    base = np.concatenate([p.base + p.offset for p in parts])[order]  # type: ignore[union-attr]
    if isinstance(first, NumberPlace):
        return NumberPlace(base, 0, first.dtype)
    if isinstance(first, RunPlace):
        runs = [np.broadcast_to(p.counts, len(p.base)) for p in parts]  # type: ignore[union-attr]
        return RunPlace(base, 0, first.dtype, np.concatenate(runs)[order])
    lengths = [np.broadcast_to(p.lengths, len(p.base)) for p in parts]  # type: ignore[union-attr]
    return TextPlace(base, 0, np.concatenate(lengths)[order])


def gather(data: Bytes, base: Positions, offset: int, size: int) -> Bytes:
    """(N, size) bytes at `base + offset` of each message; they must lie within the data."""
    if not size or not len(base):
        return np.empty((len(base), size), dtype=np.uint8)
    # numpy copies rows of opaque bytes much faster than unaligned numbers.
    rows = np.ndarray((len(data) - offset - size + 1,), f"V{size}", data, offset, (1,))
    return rows[base].view(np.uint8).reshape(len(base), size)


def numbers(data: Bytes, place: NumberPlace | RunPlace, count: int = 1) -> NDArray[Any]:
    """(N,) numbers of a place, or (N, count) of runs that have one length, in native order."""
    size = count * int(place.dtype[2])
    raw = gather(data, place.base, place.offset, size)
    found = as_numbers(raw, place.dtype)
    return found[:, 0] if isinstance(place, NumberPlace) else found


def as_numbers(raw: Bytes, dtype: str) -> NDArray[Any]:
    """Bytes (..., size) as numbers; of truth values every byte but zero is true."""
    return raw != 0 if dtype.endswith("b1") else raw.view(dtype)


def _at(value: int | Positions, index: Positions) -> int | Positions:
    return value if isinstance(value, int) else value[index]
