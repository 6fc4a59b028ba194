"""Rows of one topic, before they are in the table of their role."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry.times import Times


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
