"""One topic of one container: from its messages, whatever their encoding, to rows of a table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.geometry.times import Times
from slamreplay.ingest import DECODERS
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.encodings import deserialiser
from slamreplay.ingest.readers.reader import Block, Connection
from slamreplay.ingest.repeats import REPEATS, without_repeats
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.types import layouts
from slamreplay.ingest.wire.read import WIRE_ENCODINGS, read_messages


class TopicReader:
    """One connection on its way from blocks to rows.

    Args:
        connection: whose type has a decoder.

    Raises:
        LogError: its messages cannot be read: an unknown encoding, no definition of its type.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        is_wire = connection.encoding in WIRE_ENCODINGS
        self._layouts = layouts(connection) if is_wire else []
        self._deserialise = None if is_wire else deserialiser(connection)
        self._decoder: Decoder = DECODERS.load(connection.type)
        self._broken = 0
        self._first_broken = ""
        self._remarks: dict[tuple[Any, str], int] = {}

    def decode(self, block: Block, index: NDArray[np.int64]) -> list[TopicRows]:
        """Rows of the messages of a block at `index`."""
        t_log_ns = block.t_log_ns[index]
        unread = np.ones(len(index), dtype=bool)
        done = []
        for messages, found in self._messages(block, index, t_log_ns):
            unread[found] = False
            done += self._rows(messages)
        if self._deserialise is None and unread.any():
            self._lose("its bytes do not fit its type", t_log_ns[unread])
        return done

    def losses(self) -> list[Loss]:
        """What went wrong, once all is decoded."""
        what = self.connection.topic
        found = []
        if self._broken:
            reason = f"cannot be decoded: {self._first_broken}"
            found.append(Loss(kind="lost", what=what, count=self._broken, reason=reason))
        for path, count in self._deserialise.missing.items() if self._deserialise else ():
            reason = f"no '{path}' in it: taken as zero or empty"
            found.append(Loss(kind="repaired", what=what, count=count, reason=reason))
        for (kind, reason), count in self._remarks.items():
            found.append(Loss(kind=kind, what=what, count=count, reason=reason))
        return found

    def _messages(
        self, block: Block, index: NDArray[np.int64], t_log_ns: Times
    ) -> Iterator[tuple[Messages, NDArray[np.int64]]]:
        """Messages with the places in `index` that they came from; the others are broken."""
        start, end, topic = block.start[index], block.end[index], self.connection.topic
        if self._deserialise is None:
            of = (topic, self._layouts, self.connection.encoding)
            yield from read_messages(block.data, start, end, t_log_ns, *of)
            return
        items, whole = [], []
        for place, (a, b) in enumerate(zip(start.tolist(), end.tolist(), strict=True)):
            try:
                items.append(self._deserialise(block.data[a:b].tobytes()))
                whole.append(place)
            except ValueError as error:
                self._lose(str(error), t_log_ns[place : place + 1])
        found = np.array(whole, dtype=np.int64)
        if len(found):
            yield Messages(items, t_log_ns[found], topic), found

    def _rows(self, messages: Messages) -> list[TopicRows]:
        try:
            decoded = self._decoder.decode(messages)
        except AttributeError as error:  # a log may define a type of this name differently
            self._lose(f"its definition is another one: {error}", messages.t_log_ns)
            return []
        for remark in decoded.remarks:
            if remark.count:
                key = (remark.kind, remark.reason)
                self._remarks[key] = self._remarks.get(key, 0) + remark.count
        return [self._table_rows(part, messages) for part in (decoded, *decoded.also)]

    def _table_rows(self, part: Decoded, messages: Messages) -> TopicRows:
        rows = TopicRows(
            self.connection.topic,
            self.connection.type,
            len(messages),
            part.table or self._decoder.table,
            part.columns,
            np.asarray(part.t_sensor_ns, dtype=np.int64),
            messages.t_log_ns[part.rows],
        )
        rows, told_again = without_repeats(rows)
        if told_again:
            self._remarks["skipped", REPEATS] = (
                self._remarks.get(("skipped", REPEATS), 0) + told_again
            )
        return rows

    def _lose(self, reason: str, t_log_ns: Times) -> None:
        if not self._broken:
            self._first_broken = f"{reason} (first at log time {t_log_ns[0]} ns)"
        self._broken += len(t_log_ns)
