"""MCAP files of any profile, read from front to back with the mcap package."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError
from slamreplay.ingest.readers.reader import Connection, normalise_type

MAGIC = b"\x89MCAP0\r\n"
_FORMATS = {"ros1msg": "msg", "ros2msg": "msg", "ros2idl": "idl"}


class McapReader:
    """One .mcap file.

    A chunk whose checksum or compression is broken is lost and counted, the rest is kept; a file
    that was cut is read up to the cut.

    Raises:
        LogError: nothing readable in it.
    """

    def __init__(self, path: Path, source: Source) -> None:
        self.sources = (source,)
        self.losses: list[Loss] = []
        self._path = path
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        counts = self._counts_from_summary()
        if counts is None:
            counts = Counter(m.channel_id for m in self._messages())
        self._indices = {channel: index for index, channel in enumerate(sorted(self._channels))}
        self.connections = tuple(
            self._connection(index, self._channels[number], counts.get(number, 0))
            for number, index in self._indices.items()
        )
        if not self.connections and self.losses:
            raise LogError(self.losses[0].reason, where=path)
        self.losses.clear()  # `messages` passes the same damage again

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """See `Reader`."""
        self.losses.clear()
        for message in self._messages():
            index = self._indices.get(message.channel_id)
            if index is not None and index in wanted:
                yield index, int(message.log_time), message.data

    def _connection(self, index: int, channel: Any, count: int) -> Connection:
        schema = self._schemas.get(channel.schema_id)
        text = schema.data.decode("utf-8", "replace") if schema else ""
        form = _FORMATS.get(schema.encoding, "") if schema else ""
        kind = normalise_type(schema.name) if schema else ""
        encoding = channel.message_encoding
        return Connection(index, channel.topic, kind, encoding, text if form else "", form, count)

    def _counts_from_summary(self) -> dict[int, int] | None:
        """Messages of each channel where the file's own summary is whole."""
        from mcap.exceptions import McapError
        from mcap.reader import SeekingReader

        with self._path.open("rb") as stream:
            try:
                summary = SeekingReader(stream).get_summary()
            except (McapError, ValueError, OSError, struct.error):
                return None
        if summary is None or summary.statistics is None:
            return None
        counts: dict[int, int] = summary.statistics.channel_message_counts
        known = set(counts) <= set(summary.channels)
        if not known or sum(counts.values()) != summary.statistics.message_count:
            return None
        self._schemas, self._channels = dict(summary.schemas), dict(summary.channels)
        return counts

    def _messages(self) -> Iterator[Any]:
        from mcap.records import Channel, Chunk, Message, Schema
        from mcap.stream_reader import breakup_chunk

        last_log_time = None
        for record in self._records():
            records = [record]
            if isinstance(record, Chunk):
                try:
                    records = breakup_chunk(record, validate_crc=True)
                except Exception as error:
                    self._lose("chunks", 1, f"damaged chunk: {error}")
                    continue
            for inner in records:
                if isinstance(inner, Schema):
                    self._schemas[inner.id] = inner
                elif isinstance(inner, Channel):
                    self._channels[inner.id] = inner
                elif isinstance(inner, Message):
                    last_log_time = inner.log_time
                    yield inner
        for position, loss in enumerate(self.losses):
            if last_log_time is not None and loss.what.endswith("bytes"):
                reason = f"{loss.reason}; last good log time {last_log_time} ns"
                self.losses[position] = loss.model_copy(update={"reason": reason})

    def _records(self) -> Iterator[Any]:
        from mcap.exceptions import McapError
        from mcap.stream_reader import StreamReader

        size = self._path.stat().st_size
        with self._path.open("rb") as stream:
            reader = StreamReader(stream, emit_chunks=True, record_size_limit=size).records
            good = 0
            while True:
                try:
                    record = next(reader)
                except StopIteration:
                    return
                except (McapError, ValueError, OSError, struct.error) as error:
                    reason = f"cut or broken after byte {good}: {error or 'the file ends here'}"
                    self._lose("bytes", size - good, reason)
                    return
                good = stream.tell()
                yield record

    def _lose(self, what: str, count: int, reason: str) -> None:
        name = f"{self._path.name}: {what}"
        reason = " ".join(reason.split())
        self.losses.append(Loss(kind="lost", what=name, count=count, reason=reason))
