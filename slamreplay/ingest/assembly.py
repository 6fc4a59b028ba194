"""The rows of a table before it is written: topics one after another, and the order of time.

Columns stay where they are, in memory or on disk; rows are put in order a row group at a time, so
that a table may be larger than memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.schema import TABLES, TableSchema
from slamreplay.bundle.tables import Ragged, Table, concatenated, group_bounds
from slamreplay.geometry.times import Times
from slamreplay.ingest.rows import TopicRows


@dataclass(frozen=True, eq=False)
class Assembly:
    """Rows of one table; reads like a `Table`.

    Attributes:
        schema: of the table.
        parts: topics, and their rows' times on the bundle's clock.
        order: (N,) rows of the table in the rows of the parts one after another.
    """

    schema: TableSchema
    parts: Sequence[tuple[TopicRows, Times]]
    order: NDArray[np.int64]

    @classmethod
    def of(cls, parts: Sequence[tuple[TopicRows, Times]]) -> Assembly:
        """All rows of topics of one table, ordered by time, then by log time."""
        t_ns = np.concatenate([t for _, t in parts])
        t_log_ns = np.concatenate([topic.t_log_ns for topic, _ in parts])
        steps = np.diff(t_ns)
        if bool(((steps > 0) | ((steps == 0) & (np.diff(t_log_ns) >= 0))).all()):
            order = np.arange(len(t_ns), dtype=np.int64)
        else:
            order = np.lexsort((t_log_ns, t_ns)).astype(np.int64)
        return cls(TABLES[parts[0][0].table], parts, order)

    def __len__(self) -> int:
        return len(self.order)

    def __getitem__(self, name: str) -> Any:
        """A whole column in the order of the rows."""
        whole = concatenated([_column(part, name) for part in self.parts])
        return whole.take(self.order) if isinstance(whole, Ragged) else whole[self.order]

    @property
    def t_ns(self) -> Times:
        """(N,) times on the bundle's clock."""
        return np.asarray(self["t_ns"])

    def take(self, index: Any) -> Assembly:
        """The rows at an index array, or where a mask (N,) is true."""
        return Assembly(self.schema, self.parts, self.order[np.asarray(index)])

    def groups(self) -> Iterator[Table]:
        """The rows in parts of `GROUP_BYTES`, which are the row groups of the Parquet file."""
        size = sum(topic.nbytes for topic, _ in self.parts)
        share = len(self) / max(sum(len(topic) for topic, _ in self.parts), 1)
        for rows in group_bounds(len(self), int(size * share)):
            yield self._table(self.order[rows.start : rows.stop])

    def _table(self, index: NDArray[np.int64]) -> Table:
        ends = np.cumsum([len(topic) for topic, _ in self.parts])
        part_of = np.searchsorted(ends, index, side="right")
        chosen = [int(k) for k in np.unique(part_of)]
        local = [index[part_of == k] - (ends[k] - len(self.parts[k][0])) for k in chosen]
        place = np.concatenate([np.flatnonzero(part_of == k) for k in chosen]) if chosen else index
        back = np.argsort(place, kind="stable")
        is_sorted = bool((back == np.arange(len(back))).all())
        columns = {}
        for column in self.schema.columns:
            pieces = [
                _column(self.parts[k], column.name, rows)
                for k, rows in zip(chosen, local, strict=True)
            ]
            whole = concatenated(pieces) if pieces else []
            if not is_sorted:
                whole = whole.take(back) if isinstance(whole, Ragged) else whole[back]
            columns[column.name] = whole
        return Table(self.schema, columns)


def _column(part: tuple[TopicRows, Times], name: str, rows: NDArray[np.int64] | None = None) -> Any:
    """A column of a part, all of it or some rows (M,)."""
    topic, t_ns = part
    if name == "topic":
        return np.full(len(topic) if rows is None else len(rows), topic.topic, dtype=object)
    times = {"t_ns": t_ns, "t_sensor_ns": topic.t_sensor_ns, "t_log_ns": topic.t_log_ns}
    whole = times[name] if name in times else topic.columns[name]
    if rows is None:
        return whole
    if len(rows) and rows[-1] - rows[0] == len(rows) - 1 and bool((np.diff(rows) == 1).all()):
        first, last = int(rows[0]), int(rows[-1]) + 1
        return whole.rows(first, last) if isinstance(whole, Ragged) else whole[first:last]
    return whole.take(rows) if isinstance(whole, Ragged) else whole[rows]
