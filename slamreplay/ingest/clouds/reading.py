"""The clouds of some topics of a log, a block of the container at a time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import LogError
from slamreplay.ingest.clouds import CLOUD_TYPES
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.decoders.decoder import FieldError
from slamreplay.ingest.readers.reader import Block, Connection, Reader
from slamreplay.ingest.unpacking import Unpacker

#: Clouds of each topic by which topics are compared, and blocks looked through for them.
_FIRST, _BLOCKS = 5, 10


def cloud_batches(
    readers: Sequence[Reader], topic: str, losses: list[Loss], tick: Callable[[int], None]
) -> Iterator[Clouds]:
    """All clouds of a topic, block by block; what cannot be read is added to `losses`.

    Args:
        readers: the log's containers.
        topic: of the clouds.
        losses: of the log.
        tick: told how many clouds were read.
    """
    for reader in readers:
        wanted = _readable(reader, {topic}, losses)
        if not wanted:
            continue
        for block in reader.blocks(set(wanted)):
            for index, unpack in wanted.items():
                yield from _decoded(block, reader.connections[index], unpack)
            tick(len(block))
        losses += [loss for unpack in wanted.values() for loss in unpack.losses()]


def first_clouds(readers: Sequence[Reader], topics: Collection[str]) -> dict[str, Clouds]:
    """Topic to its first clouds, of those that have any near the log's beginning."""
    found: dict[str, Clouds] = {}
    for reader in readers:
        wanted = _readable(reader, set(topics) - set(found), [])
        if not wanted:
            continue
        for _, block in zip(range(_BLOCKS), reader.blocks(set(wanted)), strict=False):
            for index, unpack in wanted.items():
                connection = reader.connections[index]
                if connection.topic not in found:
                    for clouds in _decoded(block, connection, unpack, first=_FIRST):
                        found[connection.topic] = clouds
            if all(reader.connections[index].topic in found for index in wanted):
                break
    return found


def _readable(reader: Reader, topics: Collection[str], losses: list[Loss]) -> dict[int, Unpacker]:
    """Connections of some topics whose messages can be read."""
    wanted = {}
    for connection in reader.connections:
        if connection.topic in topics and connection.type in CLOUD_TYPES and connection.count:
            try:
                wanted[connection.index] = Unpacker(connection)
            except LogError as error:
                what = f"{connection.topic} ({connection.type})"
                loss = Loss(kind="skipped", what=what, count=connection.count, reason=str(error))
                losses.append(loss)
    return wanted


def _decoded(
    block: Block, connection: Connection, unpack: Unpacker, first: int | None = None
) -> Iterator[Clouds]:
    index = np.flatnonzero(block.connection == connection.index)[:first]
    for messages in unpack.messages(block, index):
        try:
            yield CLOUD_TYPES[connection.type](messages)
        except FieldError as error:  # a log may define a type of this name differently
            unpack.lose(f"its definition is another one: {error}", messages.t_log_ns)
