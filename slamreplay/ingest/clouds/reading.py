"""Messages of some connections of a log, so many bytes of them at a time."""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import LogError
from slamreplay.ingest.clouds import CLOUD_TYPES
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.decoders.decoder import Messages
from slamreplay.ingest.readers.reader import Connection, Reader
from slamreplay.ingest.types import deserialiser

#: Payload bytes in memory at a time.
BATCH_BYTES = 32_000_000
#: Clouds of each topic by which topics are compared, and messages looked through for them.
_FIRST, _LOOKED_THROUGH = 5, 2000


def cloud_batches(
    readers: Sequence[Reader], topic: str, losses: list[Loss], tick: Callable[[], None]
) -> Iterator[Clouds]:
    """All clouds of a topic, batch by batch; what cannot be read is added to `losses`."""
    for reader in readers:
        wanted = _readable(reader, {topic}, losses)
        if not wanted:
            continue
        held: list[tuple[int, int, bytes]] = []
        size = 0
        for message in reader.messages(set(wanted)):
            tick()
            held.append(message)
            size += len(message[2])
            if size > BATCH_BYTES:
                yield from _decoded(held, wanted, losses)
                held, size = [], 0
        yield from _decoded(held, wanted, losses)


def first_clouds(readers: Sequence[Reader], topics: Collection[str]) -> dict[str, Clouds]:
    """Topic to its first clouds, of those that have any near the log's beginning."""
    found: dict[str, Clouds] = {}
    for reader in readers:
        wanted = _readable(reader, set(topics) - set(found), [])
        if not wanted:
            continue
        held: dict[int, list[tuple[int, int, bytes]]] = {index: [] for index in wanted}
        for message in islice(reader.messages(set(wanted)), _LOOKED_THROUGH):
            if len(held[message[0]]) < _FIRST:
                held[message[0]].append(message)
            if all(len(m) == _FIRST for m in held.values()):
                break
        for index, messages in held.items():
            for clouds in _decoded(messages, wanted, []):
                found[wanted[index].topic] = clouds
    return found


def _readable(reader: Reader, topics: Collection[str], losses: list[Loss]) -> dict[int, Connection]:
    """Connections of some topics whose messages can be deserialised."""
    wanted = {}
    for connection in reader.connections:
        if connection.topic in topics and connection.type in CLOUD_TYPES and connection.count:
            try:
                deserialiser(connection)
                wanted[connection.index] = connection
            except LogError as error:
                what = f"{connection.topic} ({connection.type})"
                loss = Loss(kind="skipped", what=what, count=connection.count, reason=str(error))
                losses.append(loss)
    return wanted


def _decoded(
    held: Sequence[tuple[int, int, bytes]],
    connections: dict[int, Connection],
    losses: list[Loss],
) -> Iterator[Clouds]:
    for index in dict.fromkeys(index for index, _, _ in held):
        connection = connections[index]
        deserialise = deserialiser(connection)
        items: list[Any] = []
        times, broken = [], []
        for _, t_log_ns, data in (m for m in held if m[0] == index):
            try:
                items.append(deserialise(data))
                times.append(t_log_ns)
            except (ValueError, KeyError, IndexError, struct.error, _serde_error()) as error:
                broken.append(f"cannot be decoded: {error} (log time {t_log_ns} ns)")
        try:
            if items:
                t_log = np.array(times, dtype=np.int64)
                yield CLOUD_TYPES[connection.type](Messages(items, t_log, connection.topic))
        except AttributeError as error:  # a log may define a type of this name differently
            broken += [f"its definition is another one: {error}"] * len(items)
        if broken:
            count, topic = len(broken), connection.topic
            losses.append(Loss(kind="lost", what=topic, count=count, reason=broken[0]))


def _serde_error() -> type[Exception]:
    from rosbags.serde import SerdeError

    return SerdeError
