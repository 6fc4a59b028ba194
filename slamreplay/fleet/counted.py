"""The logs of a fleet that count, as columns: each log once, under whatever names it came."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.fleet.answers import Copies
from slamreplay.geometry import se2
from slamreplay.verdict.judgement import STATES

if TYPE_CHECKING:
    import pyarrow as pa

    from slamreplay.fleet.snapshot import Snapshot

#: States that say something of the robot and its map.
JUDGED = tuple(state for state in STATES if state not in ("unobservable", "insufficient_data"))
LOST = ("lost", "lost_and_map_changed")
CHANGED = ("map_changed", "lost_and_map_changed")

#: Outcomes of logs that are no failure kinds.
MEASURES = ("lost", "changed", "stopped", "gate")

_TEXTS = (
    "key", "log", "content", "status", "error", "site", "robot", "software", "map_version", "state",
    "failure_mode", "root_cause", "gate", "report",
)  # fmt: skip
_NUMBERS = ("lost_s", "lost_times", "changed_s", "judged_s", "driven_m", "stops", "confidence")

Texts = NDArray[np.object_]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Counted:
    """Columns of `logs`, (N,) each, in the order of the keys; None where a text is not told.

    Attributes:
        texts: by column.
        numbers: by column, 0 where they are not known but for `confidence`, which is NaN.
        start_ns: 0 where it is not known.
        day: of the start; None where it is not known.
        cluster: whose log it is: one number per robot, one of its own where nobody tells.
        copies: what was left out.
    """

    texts: Mapping[str, Texts]
    numbers: Mapping[str, se2.Array]
    start_ns: NDArray[np.int64]
    day: Texts
    cluster: NDArray[np.int64]
    copies: tuple[Copies, ...]

    def __len__(self) -> int:
        return len(self.day)

    @cached_property
    def failed(self) -> Flags:
        """Which could not be judged at all."""
        return np.asarray(self.texts["status"] != "done")

    @cached_property
    def judged(self) -> Flags:
        """Which have a verdict that says something."""
        return is_any(self.texts["state"], JUDGED)

    @cached_property
    def ordered(self) -> Flags:
        """Which can be put in order of time: all where no clock tells the day, else those."""
        dated = np.array([day is not None for day in self.day.tolist()], dtype=bool)
        return dated if dated.any() else np.ones(len(self), dtype=bool)

    @cached_property
    def cause(self) -> Texts:
        """The root cause, else how it began to fail; None of those that did not."""
        mode, root = (self.texts[name].tolist() for name in ("failure_mode", "root_cause"))
        pairs = zip(mode, root, strict=True)
        return _objects([(None if m == "none" else m) if r is None else r for m, r in pairs])

    def outcome(self, measure: str) -> tuple[Flags, Flags]:
        """Which logs tell of it, and in which it is so; of `MEASURES` or a failure kind."""
        state = self.texts["state"]
        if measure == "lost":
            return self.judged, is_any(state, LOST)
        if measure == "changed":
            return self.judged, is_any(state, CHANGED)
        if measure == "stopped":
            return np.asarray(self.texts["status"] == "done"), self.numbers["stops"] > 0
        if measure == "gate":
            gate = self.texts["gate"]
            return is_any(gate, ("passed", "failed")), np.asarray(gate == "failed")
        return self.judged, np.asarray(self.cause == measure)

    def distinct(self, column: str, rows: NDArray[np.int64] | Flags) -> int:
        """How many different values are told in these rows."""
        return len({*self.texts[column][rows].tolist()} - {None})


def is_any(values: Texts, wanted: tuple[str, ...]) -> Flags:
    """(N,) which values are one of those."""
    return np.array([value in wanted for value in values.tolist()], dtype=bool)


def counted(now: Snapshot) -> Counted:
    """The logs that count, of everything committed.

    Of a log that is there more than once (one `content`) one that could be judged counts, the first
    by name, and under one name the newest.
    """
    columns = [*_TEXTS, *_NUMBERS, "start_ns", "day"]
    tables = list(now.tables("logs", columns))
    part = np.repeat(np.arange(len(tables)), [table.num_rows for table in tables])
    texts = {name: _texts(tables, name) for name in _TEXTS}
    order, copies = _each_once(texts, part)
    numbers = {name: _floats(tables, name)[order] for name in _NUMBERS}
    kept = {name: column[order] for name, column in texts.items()}
    robot = {name: k for k, name in enumerate(sorted({*kept["robot"].tolist()} - {None}))}
    alone = len(robot) + np.arange(len(order))
    return Counted(
        texts=kept,
        numbers={k: v if k == "confidence" else np.nan_to_num(v) for k, v in numbers.items()},
        start_ns=np.nan_to_num(_integers(tables, "start_ns"))[order],
        day=_texts(tables, "day")[order],
        cluster=np.array(
            [
                own if name is None else robot[name]
                for name, own in zip(kept["robot"].tolist(), alone.tolist(), strict=True)
            ],
            dtype=np.int64,
        ),
        copies=copies,
    )


def _each_once(
    texts: Mapping[str, Texts], part: NDArray[np.int64]
) -> tuple[NDArray[np.int64], tuple[Copies, ...]]:
    """Rows that count, by key, and which of them stand for others, too."""
    keys, names, status = (texts[name].tolist() for name in ("key", "log", "status"))
    content = [c or k for c, k in zip(texts["content"].tolist(), keys, strict=True)]
    by_content: dict[str, list[int]] = {}
    for row, what in enumerate(content):
        by_content.setdefault(what, []).append(row)
    newness = part.tolist()
    first: dict[int, list[int]] = {}
    for rows in by_content.values():
        if len(rows) > 1:
            rows.sort(key=lambda k: (status[k] != "done", names[k] or "", -newness[k], keys[k]))
        first[rows[0]] = rows
    order = sorted(first, key=lambda k: keys[k])
    copies = tuple(
        Copies(content[k], keys[k], tuple(sorted({names[j] or "" for j in first[k]})))
        for k in order
        if len(first[k]) > 1
    )
    return np.array(order, dtype=np.int64), copies


def _texts(tables: list[pa.Table], name: str) -> Texts:
    return _objects([value for table in tables for value in table[name].to_pylist()])


def _objects(values: list[Any]) -> Texts:
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column


def _floats(tables: list[pa.Table], name: str) -> se2.Array:
    import pyarrow as pa

    found = [table[name].cast(pa.float64()).to_numpy() for table in tables]
    return np.concatenate([np.empty(0), *found])


def _integers(tables: list[pa.Table], name: str) -> NDArray[np.int64]:
    found = [table[name].fill_null(0).to_numpy() for table in tables]
    return np.concatenate([np.empty(0, dtype=np.int64), *found])


def groups(names: Texts) -> Iterator[tuple[Any, NDArray[np.int64]]]:
    """Rows by name, the names in order, None last."""
    rows: dict[Any, list[int]] = {}
    for row, name in enumerate(names.tolist()):
        rows.setdefault(name, []).append(row)
    for name in sorted(rows.keys() - {None}):
        yield name, np.array(rows[name], dtype=np.int64)
    if None in rows:
        yield None, np.array(rows[None], dtype=np.int64)
