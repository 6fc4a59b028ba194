"""One walk over the layout of a type, for all messages at once: where every field of each is.

A cursor is a position a message. It stays one array plus a common offset as long as the messages
agree, which those of one topic mostly do: every length is read and compared, and only where lengths
differ do the positions part. CDR (OMG formal/02-06-51, 15.3) aligns a primitive to its size from
the end of the four-byte header; ROS 1 does not align.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.ingest.wire.layout import (
    Node,
    Number,
    Struct,
    Text,
    is_fixed,
    least_size,
    offsets,
    widest,
)
from slamreplay.ingest.wire.places import (
    Bytes,
    GroupPlace,
    ManyPlace,
    NumberPlace,
    Place,
    Positions,
    RunPlace,
    TextPlace,
    gather,
    joined,
)


@dataclass(frozen=True)
class Encoding:
    """How values are laid out.

    Attributes:
        order: "<" or ">".
        most: the largest alignment: 1 for ROS 1, 8 for CDR, 4 for XCDR2.
        terminated: whether texts end with a zero that their length counts.
        padding: bytes that may follow the last field.
    """

    order: str
    most: int
    terminated: bool
    padding: int


ROS1 = Encoding("<", 1, terminated=False, padding=0)


@dataclass
class _Cursor:
    """Positions `base + offset` (N,); `phase` is known modulo `modulus` from the origin."""

    base: Positions
    offset: int
    phase: int
    modulus: int
    origin: Positions
    end: Positions
    ids: Positions

    def align(self, size: int) -> None:
        if self.modulus >= size:
            self.skip(-self.phase % size)
            return
        position = self.base + self.offset
        self.base, self.offset = position + (-(position - self.origin) & (size - 1)), 0
        self.phase, self.modulus = 0, size

    def skip(self, count: int) -> None:
        self.offset += count
        self.phase = (self.phase + count) % 8

    def advance(self, counts: int | Positions) -> None:
        if isinstance(counts, int):
            self.skip(counts)
        else:
            self.base, self.offset = self.base + self.offset + counts, 0
            self.phase, self.modulus = 0, 1


def walk(
    data: Bytes, start: Positions, end: Positions, layout: Struct, encoding: Encoding
) -> tuple[GroupPlace, NDArray[np.bool_]]:
    """Where the fields of all messages are, and which messages are sound.

    Args:
        data: the buffer.
        start: (N,) first byte of each message, which is the origin of alignment.
        end: (N,) one after its last byte.
        layout: of the type.
        encoding: of the messages.

    Returns:
        The places (M of the sound messages, in order) and the mask (N,) of those that the layout
        fits: every length within the message, every byte of it used.
    """
    sound = end - start >= least_size(layout)
    while True:
        index = np.flatnonzero(sound)
        walker = _Walker(data, encoding, len(index))
        ids = np.arange(len(index), dtype=np.int64)
        cursor = _Cursor(start[index], 0, 0, 8, start[index], end[index], ids)
        place = walker.struct(layout, cursor)
        left = cursor.end - (cursor.base + cursor.offset)
        walker.sound &= (left >= 0) & (left <= encoding.padding)
        if walker.sound.all():
            return place, sound
        sound[index[~walker.sound]] = False


class _Walker:
    """A walk under way; `sound` loses the messages whose lengths do not fit."""

    def __init__(self, data: Bytes, encoding: Encoding, count: int) -> None:
        self.data = data
        self.encoding = encoding
        self.sound = np.ones(count, dtype=bool)

    def struct(self, layout: Struct, cursor: _Cursor) -> GroupPlace:
        return GroupPlace({name: self.node(n, cursor) for name, n in layout.fields.items()})

    def node(self, node: Node, cursor: _Cursor) -> Place:
        if isinstance(node, Number):
            cursor.align(min(node.size, self.encoding.most))
            place = NumberPlace(cursor.base, cursor.offset, self.encoding.order + node.dtype)
            cursor.skip(node.size)
            return place
        if isinstance(node, Text):
            return self.text(cursor)
        if isinstance(node, Struct):
            return self.struct(node, cursor)
        counts = self.length(cursor, node.element) if node.count is None else node.count
        if isinstance(node.element, Number):
            return self.run(node.element, counts, cursor)
        return self.many(node.element, counts, cursor)

    def length(self, cursor: _Cursor, element: Node | None = None) -> int | Positions:
        """The length before a sequence or text; a message that it leads out of is not sound."""
        cursor.align(min(4, self.encoding.most))
        position = cursor.base + cursor.offset
        room = cursor.end - position - 4
        base, offset = cursor.base, cursor.offset
        short = room < 0
        if short.any():
            self.sound[cursor.ids[short]] = False
            base, offset = np.where(short, 0, position), 0
        raw = gather(self.data, base, offset, 4).view(f"{self.encoding.order}u4")[:, 0]
        lengths = raw.astype(np.int64)
        size = 1 if element is None else max(least_size(element), 1)
        wrong = short | (lengths * size > room)
        if wrong.any():
            self.sound[cursor.ids[wrong]] = False
            lengths[wrong] = 0
        cursor.skip(4)
        if len(lengths) and (lengths == lengths[0]).all():
            return int(lengths[0])
        return lengths

    def text(self, cursor: _Cursor) -> TextPlace:
        lengths = self.length(cursor)
        base, offset = cursor.base, cursor.offset
        if not self.encoding.terminated:
            cursor.advance(lengths)
            return TextPlace(base, offset, lengths)
        cursor.advance(lengths)
        if len(cursor.base):
            last = np.clip(cursor.base + cursor.offset - 1, 0, len(self.data) - 1)
            open_end = (self.data[last] != 0) & (np.asarray(lengths) > 0)
            if open_end.any():
                self.sound[cursor.ids[open_end]] = False
        bare = max(lengths - 1, 0) if isinstance(lengths, int) else np.maximum(lengths - 1, 0)
        return TextPlace(base, offset, bare)

    def run(self, element: Number, counts: int | Positions, cursor: _Cursor) -> RunPlace:
        dtype = self.encoding.order + element.dtype
        some = counts > 0
        if isinstance(counts, int) and some:
            cursor.align(min(element.size, self.encoding.most))
        elif not isinstance(counts, int):  # an empty sequence is not aligned
            before = cursor.base + cursor.offset
            cursor.align(min(element.size, self.encoding.most))
            cursor.base, cursor.offset = np.where(some, cursor.base + cursor.offset, before), 0
        place = RunPlace(cursor.base, cursor.offset, dtype, counts)
        cursor.advance(counts * element.size)
        return place

    def many(self, element: Node, counts: int | Positions, cursor: _Cursor) -> ManyPlace:
        per_message = np.full(len(cursor.base), counts) if isinstance(counts, int) else counts
        per_message = per_message.astype(np.int64)
        if is_fixed(element) and (place := self._even(element, per_message, cursor)) is not None:
            return place
        return self._uneven(element, per_message, cursor)

    def _even(self, element: Node, counts: Positions, cursor: _Cursor) -> ManyPlace | None:
        """Elements of fixed size at equal distances; None where alignment makes them unequal."""
        most = self.encoding.most
        largest = min(widest(element), most)
        if uncertain := cursor.modulus < largest:
            if offsets(element, 1, most)[0][:1] != [largest - 1]:
                return None  # the first number is not the one that settles the phase
            before = cursor.base + cursor.offset
            cursor.align(largest)  # then 0 is the phase modulo all that the element aligns to
            cursor.base = np.where(counts > 0, cursor.base + cursor.offset, before)
            cursor.offset = 0
        first, grown = offsets(element, cursor.phase, most)
        phase = (cursor.phase + grown) % 8
        inner, stride = offsets(element, phase, most)
        # Seen from the elements' ends the first one must look like those after it.
        even = [at - grown for at in first] == [at - stride for at in inner]
        if not even or (phase + stride) % 8 != phase:
            return None
        begin = cursor.base + cursor.offset
        starts = np.cumsum(counts) - counts
        within = np.arange(int(counts.sum()), dtype=np.int64) - np.repeat(starts, counts)
        base = np.repeat(begin + grown - stride, counts) + stride * within
        rows = np.repeat(np.arange(len(counts)), counts)
        sub = _Cursor(base, 0, phase, 8, cursor.origin[rows], cursor.end[rows], cursor.ids[rows])
        place = ManyPlace(counts, self.node(element, sub))
        total = np.where(counts > 0, grown + (counts - 1) * stride, 0)
        if len(total) and not uncertain and (total == total[0]).all():
            cursor.advance(int(total[0]))
        else:
            cursor.advance(total)
        return place

    def _uneven(self, element: Node, counts: Positions, cursor: _Cursor) -> ManyPlace:
        """Elements one after another: the first of all messages, then the second, and so on."""
        n = len(counts)
        most = int(counts.max()) if n else 0
        if n and (counts == most).all() and most <= 4:  # positions may go on agreeing
            parts = [self.node(element, cursor) for _ in range(most)]
            rows = [np.arange(n)] * most
        else:
            position = cursor.base + cursor.offset
            parts, rows = [], []
            for k in range(most):
                some = np.flatnonzero((counts > k) & self.sound[cursor.ids])
                if not len(some):
                    break
                sub = _Cursor(
                    position[some], 0, 0, 1, cursor.origin[some], cursor.end[some], cursor.ids[some]
                )
                parts.append(self.node(element, sub))
                rows.append(some)
                position[some] = sub.base + sub.offset
            cursor.base, cursor.offset, cursor.phase, cursor.modulus = position, 0, 0, 1
        if not parts:
            empty = np.empty(0, dtype=np.int64)
            nothing = _Cursor(empty, 0, 0, 8, empty, empty, empty)
            return ManyPlace(np.zeros(n, dtype=np.int64), self.node(element, nothing))
        whole = np.concatenate(rows)
        return ManyPlace(
            np.bincount(whole, minlength=n).astype(np.int64),
            joined(parts, np.argsort(whole, kind="stable")),
        )
