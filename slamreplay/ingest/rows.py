"""From readers to rows: every topic that has a decoder, as columns of that decoder's table."""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.bundle.tables import Ragged
from slamreplay.errors import LogError
from slamreplay.geometry.times import Times
from slamreplay.ingest import DECODERS
from slamreplay.ingest.decoders.decoder import Decoder, Messages
from slamreplay.ingest.readers.reader import Connection, Reader
from slamreplay.ingest.types import deserialiser

#: Payload bytes of one topic that are held before they are decoded.
_BATCH_BYTES = 32_000_000


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
        names, counts = np.unique(self.columns.get(column, np.array([], str)).astype(str),
                                  return_counts=True)  # fmt: skip
        return str(names[np.argmax(counts)]) if len(names) else ""


def read_rows(
    readers: Sequence[Reader],
    skip: Callable[[str], str | None],
    progress: Callable[[str, float], None] | None,
    later: Collection[str] = (),
) -> tuple[list[TopicRows], list[Loss]]:
    """Rows of every topic with a decoder, sorted by topic and type, and everything left out.

    Args:
        readers: the log's containers.
        skip: why a topic is not wanted, None if it is.
        progress: told the share of messages read.
        later: topics that somebody else reads.
    """
    losses: list[Loss] = []
    parts: dict[tuple[str, str], list[TopicRows]] = {}
    total = max(sum(c.count for reader in readers for c in reader.connections), 1)
    read = 0
    for reader in readers:
        batches = _batches(reader, skip, losses, later)
        for index, t_log_ns, data in reader.messages(set(batches)):
            read += 1
            if progress is not None and read % 2000 == 0:
                progress("reading", min(read / total, 1.0))
            batches[index].add(t_log_ns, data)
        for batch in batches.values():
            key = (batch.connection.topic, batch.connection.type)
            parts.setdefault(key, []).extend(batch.finish(losses))
        losses.extend(reader.losses)
    rows = [_joined(found) for _, found in sorted(parts.items()) if found]
    return rows, losses


def _batches(
    reader: Reader,
    skip: Callable[[str], str | None],
    losses: list[Loss],
    later: Collection[str],
) -> dict[int, _Batch]:
    batches = {}
    for connection in (c for c in reader.connections if c.topic not in later):
        reason = skip(connection.topic)
        if reason is None and connection.type not in DECODERS:
            reason = "no decoder for this type"
        if reason is None and connection.count == 0:
            continue
        if reason is None:
            try:
                batches[connection.index] = _Batch(connection)
                continue
            except LogError as error:
                reason = str(error)
        what = f"{connection.topic} ({connection.type or connection.encoding})"
        losses.append(Loss(kind="skipped", what=what, count=connection.count, reason=reason))
    return batches


class _Batch:
    """Payloads of one connection on their way to rows."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._deserialise = deserialiser(connection)
        self._decoder: Decoder = DECODERS.load(connection.type)
        self._payloads: list[bytes] = []
        self._times: list[int] = []
        self._bytes = 0
        self._broken: list[str] = []
        self._remarks: dict[tuple[Any, str], int] = {}
        self._done: list[TopicRows] = []

    def add(self, t_log_ns: int, data: bytes) -> None:
        self._payloads.append(data)
        self._times.append(t_log_ns)
        self._bytes += len(data)
        if self._bytes > _BATCH_BYTES:
            self._decode()

    def finish(self, losses: list[Loss]) -> list[TopicRows]:
        """The decoded rows; what went wrong is added to `losses`."""
        if self._payloads:
            self._decode()
        if self._broken:
            reason = f"cannot be decoded: {self._broken[0]}"
            count = len(self._broken)
            losses.append(Loss(kind="lost", what=self.connection.topic, count=count, reason=reason))
        for (kind, reason), count in self._remarks.items():
            losses.append(Loss(kind=kind, what=self.connection.topic, count=count, reason=reason))
        return self._done

    def _decode(self) -> None:
        items, times = [], []
        for t_log_ns, data in zip(self._times, self._payloads, strict=True):
            try:
                items.append(self._deserialise(data))
                times.append(t_log_ns)
            except (ValueError, KeyError, IndexError, struct.error, _serde_error()) as error:
                self._broken.append(f"{error} (log time {t_log_ns} ns)")
        t_log = np.array(times, dtype=np.int64)
        self._payloads, self._times, self._bytes = [], [], 0
        if not items:
            return
        try:
            decoded = self._decoder.decode(Messages(items, t_log, self.connection.topic))
        except AttributeError as error:  # a log may define a type of this name differently
            self._broken += [f"its definition is another one: {error}"] * len(items)
            return
        for remark in decoded.remarks:
            if remark.count:
                key = (remark.kind, remark.reason)
                self._remarks[key] = self._remarks.get(key, 0) + remark.count
        self._done.append(
            TopicRows(
                self.connection.topic,
                self.connection.type,
                len(items),
                self._decoder.table,
                decoded.columns,
                np.asarray(decoded.t_sensor_ns, dtype=np.int64),
                t_log[decoded.rows],
            )
        )


def _serde_error() -> type[Exception]:
    from rosbags.serde import SerdeError

    return SerdeError


def _joined(parts: Sequence[TopicRows]) -> TopicRows:
    """One set of rows, ordered by log time (files of one log may come in any order)."""
    first = parts[0]
    whole = replace(
        first,
        messages=sum(p.messages for p in parts),
        columns={k: _concatenate([p.columns[k] for p in parts]) for k in first.columns},
        t_sensor_ns=np.concatenate([p.t_sensor_ns for p in parts]),
        t_log_ns=np.concatenate([p.t_log_ns for p in parts]),
    )
    return whole.take(np.argsort(whole.t_log_ns, kind="stable"))


def _concatenate(columns: Iterable[Any]) -> Any:
    columns = list(columns)
    if not isinstance(columns[0], Ragged):
        return np.concatenate(columns)
    lengths = np.concatenate([c.lengths for c in columns])
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    return Ragged(np.concatenate([c.values for c in columns]), offsets)
