"""The messages of one connection, whatever their encoding: by columns, broken ones counted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.decoder import Messages
from slamreplay.ingest.encodings import deserialiser
from slamreplay.ingest.readers.reader import Block, Connection
from slamreplay.ingest.types import layouts
from slamreplay.ingest.wire.read import WIRE_ENCODINGS, read_messages


class Unpacker:
    """From blocks of bytes to the messages of one connection.

    Args:
        connection: of a container.

    Raises:
        LogError: its messages cannot be read: an unknown encoding, no definition of its type.
    """

    def __init__(self, connection: Connection) -> None:
        is_wire = connection.encoding in WIRE_ENCODINGS
        self._connection = connection
        self._layouts = layouts(connection) if is_wire else []
        self._deserialise = None if is_wire else deserialiser(connection)
        self._broken = 0
        self._first_broken = ""

    def messages(self, block: Block, index: NDArray[np.int64]) -> Iterator[Messages]:
        """The messages of a block at `index`; more than one part where byte orders are mixed."""
        start, end, t_log_ns = block.start[index], block.end[index], block.t_log_ns[index]
        if self._deserialise is not None:
            yield from self._objects(block, start, end, t_log_ns)
            return
        unread = np.ones(len(index), dtype=bool)
        of = (self._connection.topic, self._layouts, self._connection.encoding)
        for messages, found in read_messages(block.data, start, end, t_log_ns, *of):
            unread[found] = False
            yield messages
        if unread.any():
            self.lose("its bytes do not fit its type", t_log_ns[unread])

    def lose(self, reason: str, t_log_ns: Times) -> None:
        """Messages of these log times (N,) cannot be used."""
        if not self._broken:
            self._first_broken = f"{reason} (first at log time {t_log_ns[0]} ns)"
        self._broken += len(t_log_ns)

    def losses(self) -> list[Loss]:
        """What went wrong so far."""
        found, what = [], self._connection.topic
        if self._broken:
            reason = f"cannot be decoded: {self._first_broken}"
            found.append(Loss(kind="lost", what=what, count=self._broken, reason=reason))
        for path, count in self._deserialise.missing.items() if self._deserialise else ():
            reason = f"no '{path}' in it: taken as zero or empty"
            found.append(Loss(kind="repaired", what=what, count=count, reason=reason))
        return found

    def _objects(
        self, block: Block, start: NDArray[np.int64], end: NDArray[np.int64], t_log_ns: Times
    ) -> Iterator[Messages]:
        assert self._deserialise is not None
        items, whole = [], []
        for place, (a, b) in enumerate(zip(start.tolist(), end.tolist(), strict=True)):
            try:
                items.append(self._deserialise(block.data[a:b].tobytes()))
                whole.append(place)
            except ValueError as error:
                self.lose(str(error), t_log_ns[place : place + 1])
        if items:
            yield Messages(items, t_log_ns[whole], self._connection.topic)
