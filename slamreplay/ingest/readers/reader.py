"""What every container gives: who spoke (connections) and what was recorded (raw messages)."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Protocol

from slamreplay.bundle.manifest import Loss, Source


@dataclass(frozen=True)
class Connection:
    """One topic with one type as one container knows it.

    Attributes:
        index: number within its reader.
        topic: name of the topic.
        type: normalised type name, `package/msg/Type`, for ROS 1 too.
        encoding: how messages are serialised: "ros1", "cdr", or what else the container says.
        definition: text of the type's definition; empty where the container has none.
        definition_format: "msg" or "idl".
        count: messages the container says it holds.
    """

    index: int
    topic: str
    type: str
    encoding: str
    definition: str
    definition_format: str
    count: int


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
        """What could not be read; complete once `messages` was exhausted."""
        ...

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Connection index, log time in ns and payload of the wanted connections' messages."""
        ...


def normalise_type(name: str) -> str:
    """`package/msg/Type` of ROS 1's `package/Type` and ROS 2's own spelling."""
    package, _, rest = name.strip().partition("/")
    return f"{package}/msg/{rest}" if rest and "/" not in rest else name.strip()
