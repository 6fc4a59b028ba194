"""What a decoder is given and what it gives back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry.times import NO_STAMP, Times, stamp_ns
from slamreplay.geometry.transforms import clean_frame


class FieldError(AttributeError):
    """A message type lacks a field, or has one of another kind under its name."""


class Messages:
    """The messages of one topic, field by field.

    Paths are dotted ("info.resolution"); the empty path is the message itself, for sequences of
    texts. These are message objects in memory; `ingest.wire` reads the same from bytes.

    Args:
        items: deserialised messages, in the order they were read: objects with the fields of the
            message definition as attributes.
        t_log_ns: (N,) when each was recorded.
        topic: its name, for types whose meaning stands in it (an action's status, a signal).
    """

    def __init__(self, items: Sequence[Any], t_log_ns: Times, topic: str = "") -> None:
        self._items = items
        self.topic = topic
        self.t_log_ns = np.asarray(t_log_ns, dtype=np.int64)

    def __len__(self) -> int:
        return len(self._items)

    def has(self, path: str) -> bool:
        """Whether the message definition has the field (False where there are no messages)."""
        value = self._items[0] if len(self) else None
        for name in path.split("."):
            if not hasattr(value, name):
                return False
            value = getattr(value, name)
        return True

    def column(self, path: str, dtype: Any = np.float64) -> NDArray[Any]:
        """(N,) a scalar field."""
        get = _getter(path)
        return np.array([get(m) for m in self._items], dtype=dtype)

    def columns(self, path: str, names: str) -> NDArray[np.float64]:
        """(N, len(names)) one-letter number fields of a struct: `columns("pose.position", "xyz")`.

        An empty path takes them from the message itself.
        """
        get = attrgetter(*(f"{path}.{n}" if path else n for n in names))
        return np.array([get(m) for m in self._items], dtype=np.float64).reshape(-1, len(names))

    def fixed(self, path: str, size: int) -> NDArray[np.float64]:
        """(N, size) an array field of fixed length."""
        get = _getter(path)
        out = np.array([get(m) for m in self._items], dtype=np.float64)
        return out.reshape(-1, size)

    def ragged(self, path: str, dtype: Any) -> Ragged:
        """N rows of an array field of any length."""
        get = _getter(path)
        return Ragged.of((get(m) for m in self._items), dtype)

    def texts(self, path: str) -> NDArray[Any]:
        """(N,) object array of a string field."""
        get = _getter(path)
        out = np.empty(len(self), dtype=object)
        out[:] = [get(m) for m in self._items]
        return out

    def frames(self, path: str = "header.frame_id") -> NDArray[Any]:
        """(N,) frame names without the leading slash of ROS 1."""
        out = np.empty(len(self), dtype=object)
        out[:] = [clean_frame(name) for name in self.texts(path)]
        return out

    def stamps(self, path: str = "header.stamp") -> Times:
        """(N,) stamps in ns, NO_STAMP where a message carries a zero."""
        stamps = stamp_ns(
            self.column(f"{path}.sec", np.int64), self.column(f"{path}.nanosec", np.int64)
        )
        return np.where(stamps == 0, NO_STAMP, stamps)

    def children(self, path: str) -> tuple[Messages, NDArray[np.int64]]:
        """Elements of a sequence of structs, all in one, and for each its message's index."""
        get = _getter(path)
        lists = [get(m) for m in self._items]
        rows = np.repeat(np.arange(len(lists)), [len(x) for x in lists]).astype(np.int64)
        return Messages([e for x in lists for e in x], self.t_log_ns[rows], self.topic), rows

    def take(self, mask: NDArray[np.bool_]) -> Messages:
        """The messages where the mask (N,) is true."""
        items = [m for m, wanted in zip(self._items, mask, strict=True) if wanted]
        return Messages(items, self.t_log_ns[mask], self.topic)

    @cached_property
    def every(self) -> NDArray[np.int64]:
        """(N,) 0 to N-1: the `rows` of a decoder that makes one row of each message."""
        return np.arange(len(self), dtype=np.int64)


def _getter(path: str) -> Callable[[Any], Any]:
    return attrgetter(path) if path else lambda item: item


@dataclass(frozen=True)
class Remark:
    """How many rows were mended or could not be used, and why (a `Loss` without its topic)."""

    kind: Literal["skipped", "lost", "repaired"]
    count: int
    reason: str


@dataclass(frozen=True, eq=False)
class Decoded:
    """Rows of one table from the messages of one topic.

    Attributes:
        columns: the table's columns but for t_ns, t_sensor_ns, t_log_ns and topic.
        rows: (M,) index of the message each row came from.
        t_sensor_ns: (M,) header stamps, NO_STAMP where there is none.
        remarks: what was repaired, lost or skipped; those with count 0 are ignored.
        table: another table than the decoder's, where the topic's name asks for it.
        also: rows of further tables that the same messages hold.
    """

    columns: Mapping[str, Any]
    rows: NDArray[np.int64]
    t_sensor_ns: Times
    remarks: tuple[Remark, ...] = field(default=())
    table: str = ""
    also: tuple[Decoded, ...] = field(default=())


@dataclass(frozen=True)
class Decoder:
    """A message type's meaning.

    Attributes:
        table: name of the table it fills. Topics may be moved to another table by their role (an
            Odometry that is a reference, an OccupancyGrid that is the map).
        decode: from the messages of one topic to rows.
    """

    table: str
    decode: Callable[[Messages], Decoded]
