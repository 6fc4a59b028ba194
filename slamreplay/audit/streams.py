"""The log as streams: what one publisher says of one thing, in the order it was recorded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.geometry.times import NO_STAMP, Times

#: Tables of measurements, whose stamps say when something was measured.
SENSOR_TABLES = ("scans", "odometry", "imu", "points")


@dataclass(frozen=True, eq=False)
class Stream:
    """Rows of one topic, of tf those of one edge, ordered by log time.

    Attributes:
        topic: name of the topic.
        table: the table its rows are in.
        edge: parent and child frame of an edge on tf, None elsewhere.
        is_static: an edge that holds at all times, or a topic that is latched.
        rows: (N,) where the rows stand in the table.
        t_ns: (N,) times on the bundle's clock.
        t_sensor_ns: (N,) header stamps, NO_STAMP where there is none.
        t_log_ns: (N,) log times, ascending.
    """

    topic: str
    table: str
    edge: tuple[str, str] | None
    is_static: bool
    rows: NDArray[np.int64]
    t_ns: Times
    t_sensor_ns: Times
    t_log_ns: Times

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def name(self) -> str:
        """What a sentence calls it: "/scan", "/tf odom -> base_link"."""
        return self.topic if self.edge is None else f"{self.topic} {' -> '.join(self.edge)}"

    @cached_property
    def stamped(self) -> NDArray[np.bool_]:
        """(N,) rows that carry a stamp."""
        return np.asarray(self.t_sensor_ns != NO_STAMP)

    def is_edge(self, one: str | None, other: str | None) -> bool:
        """Whether it is the edge between two frames, whichever way round."""
        return self.edge is not None and {*self.edge} == {one, other}


#: What is said once and kept: its stamp may be of the day before.
_LATCHED = ("map_updates", "initial_poses", "plans", "health", "recoveries")


def streams(read: Callable[[str], Table]) -> list[Stream]:
    """Every stream of a bundle or view, in the order of the tables, then by name.

    Args:
        read: gives a table by name: `Bundle.table` for all of it, `BundleView.recorded` for what a
            check may see.
    """
    return [stream for name in TABLES for stream in _of_table(read(name), name)]


def _of_table(table: Table, name: str) -> list[Stream]:
    if not len(table):
        return []
    columns = ("topic", "parent_frame", "child_frame") if name == "transforms" else ("topic",)
    codes, names = _coded([table[c] for c in columns])
    order = np.lexsort((table["t_log_ns"], codes))
    starts = np.flatnonzero(np.append(True, np.diff(codes[order]) != 0))
    found = []
    for rows in np.split(order, starts[1:]):
        topic, *edge = names[codes[rows[0]]]
        found.append(
            Stream(
                topic,
                name,
                (edge[0], edge[1]) if edge else None,
                bool(table["is_static"][rows].all()) if edge else name in _LATCHED,
                rows,
                table.t_ns[rows],
                table["t_sensor_ns"][rows],
                table["t_log_ns"][rows],
            )
        )
    return sorted(found, key=lambda s: (s.topic, s.edge or ()))


def _coded(columns: Sequence[NDArray[np.object_]]) -> tuple[NDArray[np.int64], list[list[str]]]:
    """A number (N,) for each combination of texts, and the texts of each number."""
    parts = [pa.array(c, pa.string()).dictionary_encode() for c in columns]
    code = np.zeros(len(columns[0]), dtype=np.int64)
    for part in parts:
        code = code * max(len(part.dictionary), 1) + part.indices.to_numpy()
    unique, first, code = np.unique(code, return_index=True, return_inverse=True)
    texts = [[str(c[row]) for c in columns] for row in first[: len(unique)]]
    return code.astype(np.int64), texts
