"""What every container gives: who spoke (connections) and what was recorded (blocks)."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.geometry.times import Times
from slamreplay.messages.foxglove import SCHEMA_PREFIX, TYPE_PREFIX

#: Bytes of a container that are held and decoded at a time.
WINDOW_BYTES = 24_000_000


@dataclass(frozen=True)
class Connection:
    """One topic with one type as one container knows it.

    Attributes:
        index: number within its reader.
        topic: name of the topic.
        type: normalised type name, `package/msg/Type`, for ROS 1 and Foxglove's schemas too.
        encoding: how messages are serialised: "ros1", "cdr", "json", "protobuf", or what else the
            container says.
        definition: text of the type's definition; empty where the container has none.
        definition_format: "msg", "idl", or the container's word for another kind of schema.
        count: messages the container says it holds.
        schema: the definition as recorded, whatever it is written in (protobuf: a serialised
            FileDescriptorSet).
    """

    index: int
    topic: str
    type: str
    encoding: str
    definition: str
    definition_format: str
    count: int
    schema: bytes = b""


@dataclass(frozen=True, eq=False)
class Block:
    """Messages in the order of the container, as pieces of one buffer.

    Attributes:
        data: the bytes.
        connection: (N,) index of each message's connection.
        start: (N,) first byte of each payload.
        end: (N,) one after its last byte.
        t_log_ns: (N,) log times.
    """

    data: NDArray[np.uint8]
    connection: NDArray[np.int64]
    start: NDArray[np.int64]
    end: NDArray[np.int64]
    t_log_ns: Times

    def __len__(self) -> int:
        return len(self.start)

    @classmethod
    def of(cls, data: bytes | memoryview, found: list[tuple[int, int, int, int]]) -> Block:
        """From (connection, start, end, log time) of each message."""
        columns = np.array(found, dtype=np.int64).reshape(-1, 4)
        return cls(np.frombuffer(data, dtype=np.uint8), *np.ascontiguousarray(columns.T))

    @classmethod
    def joined(cls, blocks: list[Block]) -> Block:
        """One block after another."""
        if len(blocks) == 1:
            return blocks[0]
        shifts = np.cumsum([0, *(len(b.data) for b in blocks[:-1])])
        return cls(
            np.concatenate([b.data for b in blocks]),
            np.concatenate([b.connection for b in blocks]),
            np.concatenate([b.start + s for b, s in zip(blocks, shifts, strict=True)]),
            np.concatenate([b.end + s for b, s in zip(blocks, shifts, strict=True)]),
            np.concatenate([b.t_log_ns for b in blocks]),
        )


class Reader(Protocol):
    """A container opened for reading."""

    @property
    def sources(self) -> tuple[Source, ...]:
        """The files behind it."""
        ...

    @property
    def connections(self) -> tuple[Connection, ...]:
        """In the order of their `index`."""
        ...

    @property
    def losses(self) -> list[Loss]:
        """What could not be read; complete once `blocks` was exhausted."""
        ...

    def blocks(self, wanted: Collection[int]) -> Iterator[Block]:
        """The messages of the wanted connections, about `WINDOW_BYTES` at a time."""
        ...


def normalise_type(name: str) -> str:
    """`package/msg/Type` of ROS 1's `package/Type`, ROS 2's own spelling, and `foxglove.Type`."""
    name = name.strip()
    if name.startswith((SCHEMA_PREFIX, "foxglove/")):
        return TYPE_PREFIX + name[len(SCHEMA_PREFIX) :].removeprefix("msg/")
    package, _, rest = name.partition("/")
    return f"{package}/msg/{rest}" if rest and "/" not in rest else name
