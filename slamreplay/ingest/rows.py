"""From readers to rows: every topic that has a decoder, as columns of that decoder's table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
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
) -> tuple[list[TopicRows], list[Loss]]:
    """Rows of every topic with a decoder, sorted by topic and type, and everything left out.

    Args:
        readers: the log's containers.
        skip: why a topic is not wanted, None if it is.
        progress: told the share of messages read.
    """
    losses: list[Loss] = []
    parts: dict[tuple[str, str], list[TopicRows]] = {}
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
                    topic.add(block, index)
            read += len(block)
            if progress is not None:
                progress("reading", min(read / total, 1.0))
        for topic in topics.values():
            key = (topic.connection.topic, topic.connection.type)
            parts.setdefault(key, []).extend(topic.finish(losses))
        losses.extend(reader.losses)
    return [_joined(parts.pop(key)) for key in sorted(parts) if parts[key]], losses


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
        self._done: list[TopicRows] = []

    def add(self, block: Block, index: NDArray[np.int64]) -> None:
        """Decode the messages of a block at `index`."""
        t_log_ns = block.t_log_ns[index]
        unread = np.ones(len(index), dtype=bool)
        for messages, found in read_messages(
            block.data, block.start[index], block.end[index], t_log_ns, self.connection.topic,
            self._layouts, self.connection.encoding,
        ):  # fmt: skip
            unread[found] = False
            self._decode(messages)
        if unread.any():
            self._lose("its bytes do not fit its type", t_log_ns[unread])

    def finish(self, losses: list[Loss]) -> list[TopicRows]:
        """The decoded rows; what went wrong is added to `losses`."""
        what = self.connection.topic
        for reason, (count, t_log_ns) in self._broken.items():
            said = f"cannot be decoded: {reason} (first at log time {t_log_ns} ns)"
            losses.append(Loss(kind="lost", what=what, count=count, reason=said))
        for (kind, reason), count in self._remarks.items():
            losses.append(Loss(kind=kind, what=what, count=count, reason=reason))
        return self._done

    def _decode(self, messages: Messages) -> None:
        try:
            decoded = self._decoder.decode(messages)
        except FieldError as error:  # a log may define a type of this name differently
            self._lose(f"its definition is another one: {error}", messages.t_log_ns)
            return
        for remark in decoded.remarks:
            if remark.count:
                key = (remark.kind, remark.reason)
                self._remarks[key] = self._remarks.get(key, 0) + remark.count
        self._done.append(
            TopicRows(
                self.connection.topic,
                self.connection.type,
                len(messages),
                self._decoder.table,
                decoded.columns,
                np.asarray(decoded.t_sensor_ns, dtype=np.int64),
                messages.t_log_ns[decoded.rows],
            )
        )

    def _lose(self, reason: str, t_log_ns: Times) -> None:
        count, first = self._broken.get(reason, (0, int(t_log_ns[0])))
        self._broken[reason] = (count + len(t_log_ns), first)


def _joined(parts: Sequence[TopicRows]) -> TopicRows:
    """One set of rows, ordered by log time (files of one log may come in any order)."""
    first = parts[0]
    whole = replace(
        first,
        messages=sum(p.messages for p in parts),
        columns={k: concatenated([p.columns[k] for p in parts]) for k in first.columns},
        t_sensor_ns=np.concatenate([p.t_sensor_ns for p in parts]),
        t_log_ns=np.concatenate([p.t_log_ns for p in parts]),
    )
    if (whole.t_log_ns[1:] >= whole.t_log_ns[:-1]).all():
        return whole
    return whole.take(np.argsort(whole.t_log_ns, kind="stable"))
