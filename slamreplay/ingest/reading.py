"""From readers to rows: every topic that has a decoder, as columns of that decoder's table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import LogError
from slamreplay.ingest import DECODERS
from slamreplay.ingest.collected import Collected
from slamreplay.ingest.readers.reader import Reader
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.topic_reader import TopicReader


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
    rows = Collected(spill)
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
                    rows.add(topic.decode(block, index))
            read += len(block)
            if progress is not None:
                progress("reading", min(read / total, 1.0))
        for topic in topics.values():
            losses.extend(topic.losses())
        losses.extend(reader.losses)
    return rows.finish(), losses


def _topics(
    reader: Reader, skip: Callable[[str], str | None], losses: list[Loss]
) -> dict[int, TopicReader]:
    topics = {}
    for connection in reader.connections:
        reason = skip(connection.topic)
        if reason is None and connection.type not in DECODERS:
            reason = "no decoder for this type"
        if reason is None and connection.count == 0:
            continue
        if reason is None:
            try:
                topics[connection.index] = TopicReader(connection)
                continue
            except LogError as error:
                reason = str(error)
        what = f"{connection.topic} ({connection.type or connection.encoding})"
        losses.append(Loss(kind="skipped", what=what, count=connection.count, reason=reason))
    return topics
