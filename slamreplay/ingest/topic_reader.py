"""One topic of one container: from its messages, whatever their encoding, to rows of a table."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.ingest import DECODERS
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.readers.reader import Block, Connection
from slamreplay.ingest.repeats import REPEATS, without_repeats
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.unpacking import Unpacker


class TopicReader:
    """One connection on its way from blocks to rows.

    Args:
        connection: whose type has a decoder.

    Raises:
        LogError: its messages cannot be read: an unknown encoding, no definition of its type.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._unpack = Unpacker(connection)
        self._decoder: Decoder = DECODERS.load(connection.type)
        self._remarks: dict[tuple[Any, str], int] = {}

    def decode(self, block: Block, index: NDArray[np.int64]) -> list[TopicRows]:
        """Rows of the messages of a block at `index`."""
        return [rows for m in self._unpack.messages(block, index) for rows in self._rows(m)]

    def losses(self) -> list[Loss]:
        """What went wrong, once all is decoded."""
        what = self.connection.topic
        found = self._unpack.losses()
        for (kind, reason), count in self._remarks.items():
            found.append(Loss(kind=kind, what=what, count=count, reason=reason))
        return found

    def _rows(self, messages: Messages) -> list[TopicRows]:
        try:
            decoded = self._decoder.decode(messages)
        except AttributeError as error:  # a log may define a type of this name differently
            self._unpack.lose(f"its definition is another one: {error}", messages.t_log_ns)
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
