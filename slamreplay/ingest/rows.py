"""From readers to rows: every topic that has a decoder, as columns of that decoder's table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.bundle.tables import Ragged, concatenated
from slamreplay.errors import LogError
from slamreplay.geometry.times import Times
from slamreplay.ingest import DECODERS
from slamreplay.ingest.decoders.decoder import Decoder, FieldError, Messages
from slamreplay.ingest.readers.reader import Block, Connection, Reader
from slamreplay.ingest.spill import MEMORY_BYTES, SpilledColumns
from slamreplay.ingest.types import layouts
from slamreplay.ingest.wire.read import read_messages


@dataclass(frozen=True, eq=False)
class TopicRows:
    """All rows of one topic and type, ordered by log time.

    Attributes:
        topic: name of the topic.
        type: normalised message type.
        messages: messages read, those without a row included.
        table: table the rows belong to.
        columns: the table's columns but for the times and the topic.
        t_sensor_ns: (N,) header stamps, NO_STAMP where there is none.
        t_log_ns: (N,) log times.
    """

    topic: str
    type: str
    messages: int
    table: str
    columns: Mapping[str, Any]
    t_sensor_ns: Times
    t_log_ns: Times

    def __len__(self) -> int:
        return len(self.t_log_ns)

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return sum(c.nbytes for c in self.columns.values()) + 3 * self.t_log_ns.nbytes

    @property
    def rate_hz(self) -> float:
        """Messages per second of log time, 0 where it cannot be said."""
        span = float(self.t_log_ns[-1] - self.t_log_ns[0]) / 1e9 if len(self) > 1 else 0.0
        return (self.messages - 1) / span if span > 0 else 0.0

    def take(self, index: NDArray[np.int64]) -> TopicRows:
        """The rows at an index array."""
        columns = {
            k: v.take(index) if isinstance(v, Ragged) else v[index] for k, v in self.columns.items()
        }
        return replace(
            self,
            columns=columns,
            t_sensor_ns=self.t_sensor_ns[index],
            t_log_ns=self.t_log_ns[index],
        )

    def frame(self, column: str = "frame_id") -> str:
        """The frame most rows have in a column, "" where there is none."""
        counts = Counter(self.columns[column].tolist()) if column in self.columns else {}
        return str(max(sorted(counts), key=counts.__getitem__)) if counts else ""


def read_rows(
    readers: Sequence[Reader],
    skip: Callable[[str], str | None],
    progress: Callable[[str, float], None] | None,
    spill: Path | None = None,
) -> tuple[list[TopicRows], list[Loss]]:
    """Rows of every topic with a decoder, sorted by topic and type, and everything left out.

    Args:
        readers: the log's containers.
        skip: why a topic is not wanted, None if it is.
        progress: told the share of messages read.
        spill: an empty folder for the columns of logs that are larger than memory; without one
            everything stays in memory.
    """
    losses: list[Loss] = []
    store = Store(spill)
    total = max(sum(c.count for reader in readers for c in reader.connections), 1)
    read = 0
    for reader in readers:
        topics = _topics(reader, skip, losses)
        for block in reader.blocks(set(topics)):
            order = np.argsort(block.connection, kind="stable")
            ends = np.cumsum(np.bincount(block.connection, minlength=len(reader.connections)))
            for connection, topic in topics.items():
                index = order[ends[connection - 1] if connection else 0 : ends[connection]]
                if len(index):
                    store.add(topic.decode(block, index))
            read += len(block)
            if progress is not None:
                progress("reading", min(read / total, 1.0))
        for topic in topics.values():
            losses.extend(topic.losses())
        losses.extend(reader.losses)
    return store.finish(), losses


def _topics(
    reader: Reader, skip: Callable[[str], str | None], losses: list[Loss]
) -> dict[int, _Topic]:
    topics = {}
    for connection in reader.connections:
        reason = skip(connection.topic)
        if reason is None and connection.type not in DECODERS:
            reason = "no decoder for this type"
        if reason is None and connection.count == 0:
            continue
        if reason is None:
            try:
                topics[connection.index] = _Topic(connection)
                continue
            except LogError as error:
                reason = str(error)
        what = f"{connection.topic} ({connection.type or connection.encoding})"
        losses.append(Loss(kind="skipped", what=what, count=connection.count, reason=reason))
    return topics


class _Topic:
    """One connection on its way from blocks to rows."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._layouts = layouts(connection)
        self._decoder: Decoder = DECODERS.load(connection.type)
        self._broken: dict[str, tuple[int, int]] = {}
        self._remarks: dict[tuple[Any, str], int] = {}

    def decode(self, block: Block, index: NDArray[np.int64]) -> list[TopicRows]:
        """Rows of the messages of a block at `index`."""
        t_log_ns = block.t_log_ns[index]
        unread = np.ones(len(index), dtype=bool)
        done = []
        for messages, found in read_messages(
            block.data, block.start[index], block.end[index], t_log_ns, self.connection.topic,
            self._layouts, self.connection.encoding,
        ):  # fmt: skip
            unread[found] = False
            done += self._rows(messages)
        if unread.any():
            self._lose("its bytes do not fit its type", t_log_ns[unread])
        return done

    def losses(self) -> list[Loss]:
        """What went wrong, once all is decoded."""
        what = self.connection.topic
        found = []
        for reason, (count, t_log_ns) in self._broken.items():
            said = f"cannot be decoded: {reason} (first at log time {t_log_ns} ns)"
            found.append(Loss(kind="lost", what=what, count=count, reason=said))
        for (kind, reason), count in self._remarks.items():
            found.append(Loss(kind=kind, what=what, count=count, reason=reason))
        return found

    def _rows(self, messages: Messages) -> list[TopicRows]:
        try:
            decoded = self._decoder.decode(messages)
        except FieldError as error:  # a log may define a type of this name differently
            self._lose(f"its definition is another one: {error}", messages.t_log_ns)
            return []
        for remark in decoded.remarks:
            if remark.count:
                key = (remark.kind, remark.reason)
                self._remarks[key] = self._remarks.get(key, 0) + remark.count
        return [
            TopicRows(
                self.connection.topic,
                self.connection.type,
                len(messages),
                self._decoder.table,
                decoded.columns,
                np.asarray(decoded.t_sensor_ns, dtype=np.int64),
                messages.t_log_ns[decoded.rows],
            )
        ]

    def _lose(self, reason: str, t_log_ns: Times) -> None:
        count, first = self._broken.get(reason, (0, int(t_log_ns[0])))
        self._broken[reason] = (count + len(t_log_ns), first)


class Store:
    """Rows of all topics while a log is read, in memory or, past `MEMORY_BYTES`, on disk.

    Args:
        folder: for the columns on disk; None to keep everything in memory.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._held = 0
        self._parts: dict[tuple[str, str], list[TopicRows]] = {}
        self._columns: dict[tuple[str, str], SpilledColumns] = {}

    def add(self, parts: Sequence[TopicRows]) -> None:
        """Rows of one topic, after those that are there."""
        for part in parts:
            key = (part.topic, part.type)
            self._parts.setdefault(key, []).append(part)
            self._held += part.nbytes
            if key in self._columns:
                self._spill(key)
        if self._folder is not None and self._held > MEMORY_BYTES:
            for key in self._parts:
                self._spill(key)
            self._held = 0

    def finish(self) -> list[TopicRows]:
        """One set of rows for each topic and type, sorted by these."""
        return [_joined(self._parts.pop(key)) for key in sorted(self._parts)]

    def _spill(self, key: tuple[str, str]) -> None:
        """Put a topic's columns on disk; they stand for all its parts from then on."""
        parts = self._parts[key]
        if key not in self._columns and self._folder is not None:
            self._columns[key] = SpilledColumns(self._folder / str(len(self._columns)))
        columns = self._columns[key]
        for part in parts:
            if part.columns is not columns:
                columns.append(part.columns, len(part))
        self._parts[key] = [_times_joined(parts, columns)]


def _joined(parts: list[TopicRows]) -> TopicRows:
    """One set of rows, ordered by log time (files of one log may come in any order)."""
    columns = parts[0].columns
    if len(parts) > 1:  # a column at a time, so that no more than one of them is there twice
        own = [dict(p.columns) for p in parts]
        names = list(columns)
        parts[:] = [replace(p, columns={}) for p in parts]
        columns = {name: concatenated([c.pop(name) for c in own]) for name in names}
    whole = _times_joined(parts, columns)
    if (whole.t_log_ns[1:] >= whole.t_log_ns[:-1]).all():
        return whole
    return whole.take(np.argsort(whole.t_log_ns, kind="stable"))


def _times_joined(parts: Sequence[TopicRows], columns: Mapping[str, Any]) -> TopicRows:
    return replace(
        parts[0],
        messages=sum(p.messages for p in parts),
        columns=columns,
        t_sensor_ns=np.concatenate([p.t_sensor_ns for p in parts]),
        t_log_ns=np.concatenate([p.t_log_ns for p in parts]),
    )
