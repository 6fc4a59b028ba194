"""The table of --maps: which map, topics, robot and labels belong to which logs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from slamreplay.batch.addresses import beside, shown
from slamreplay.batch.delimited import Row, read_rows
from slamreplay.batch.fetch import local_log
from slamreplay.batch.patterns import Pattern, filled, pattern_of
from slamreplay.batch.small_files import read_small
from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.batch.task import LogSource

#: Columns with a meaning; all others are labels.
COLUMNS = ("pattern", "map", "topics", "robot_ns")
_MOST = 5_000_000


@dataclass(frozen=True)
class MapsRow:
    """What one row says.

    Attributes:
        number: of the row in the table, for remarks.
        pattern: of the addresses it is about.
        map: path or address of a map's yaml, `{name}` in it to be filled; None without one.
        topics: the same of a topics file.
        robot: the same, a namespace.
        labels: of its own columns.
    """

    number: int
    pattern: Pattern
    map: str | None
    topics: str | None
    robot: str | None
    labels: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class MapsTable:
    """The rows in their order; of those that fit a log the first counts.

    Attributes:
        where: the table, as it is shown.
        rows: of it.
    """

    where: str
    rows: tuple[MapsRow, ...]

    def applied(self, sources: Sequence[LogSource]) -> tuple[list[LogSource], list[str]]:
        """The logs with what the table says of them, and remarks: rows and logs left over.

        What a manifest said of a log already holds against the table.
        """
        used: Counter[int] = Counter()
        found, alone = [], []
        for source in sources:
            row, labels = self._row_of(source)
            if row is None:
                alone.append(source.log)
                found.append(source)
            else:
                used[row.number] += 1
                found.append(_with(source, row, labels))
        idle = [f"row {r.number}, '{r.pattern.text}'" for r in self.rows if not used[r.number]]
        remarks = []
        for left, of, what in (
            (idle, len(self.rows), "rows fit no log"), (alone, len(sources), "logs fit no row"),
        ):  # fmt: skip
            if left:
                others = " and others" if len(left) > 1 else ""
                remarks.append(f"{self.where}: {len(left)} of {of} {what}: {left[0]}{others}")
        return found, remarks

    def _row_of(self, source: LogSource) -> tuple[MapsRow | None, dict[str, str]]:
        address = address_of(source)
        for row in self.rows:
            labels = row.pattern.match(address)
            if labels is not None:
                return row, labels
        return None, {}


def address_of(source: LogSource) -> str:
    """What patterns are held against: an absolute path, or the address as it is shown."""
    path = local_log(source)
    return source.log if path is None else path.as_posix()


def read_maps_table(place: str, storage: Mapping[str, object]) -> MapsTable:
    """The table in a CSV file.

    Columns: `pattern` (see `patterns`; one that begins with no `/` and no scheme fits the last
    parts of an address); `map` and `topics`, paths relative to the table or addresses; `robot_ns`;
    every other column is a label. `{name}` in map, topics and robot_ns is what that place of the
    pattern fitted; named places are labels, too.

    Raises:
        UsageError: a table that makes no sense: one line with row, column and a hint.
        LogError: it cannot be read.
    """
    where = shown(place)
    rows = read_rows(read_small(place, storage, most=_MOST), where,
                     required="pattern", known=COLUMNS)  # fmt: skip
    if not rows:
        raise UsageError("a table without rows", where=where)
    return MapsTable(where, tuple(_row(row, place, where) for row in rows))


def _row(row: Row, place: str, where: str) -> MapsRow:
    cells = dict(row.cells)
    try:
        pattern = pattern_of(cells.pop("pattern"), anywhere=True)
    except UsageError as error:
        raise UsageError(f"row {row.number}, column pattern: {error.what}", where=where,
                         hint=error.hint) from error  # fmt: skip
    for name in pattern.names:
        if name in cells:
            raise UsageError(
                f"row {row.number}, column {name}: the pattern has {{{name}}} as well", where=where,
                hint="leave the cell empty, or put * into the pattern",
            )  # fmt: skip
    empty = dict.fromkeys(pattern.names, "x")
    for column in COLUMNS[1:]:
        try:
            filled(cells.get(column, ""), empty)
        except UsageError as error:
            raise UsageError(f"row {row.number}, column {column}: {error.what}",
                             where=where) from error  # fmt: skip
    return MapsRow(
        row.number,
        pattern,
        beside(place, cells.pop("map", None)),
        beside(place, cells.pop("topics", None)),
        cells.pop("robot_ns", None),
        cells,
    )


def _with(source: LogSource, row: MapsRow, labels: dict[str, str]) -> LogSource:
    def value(text: str | None) -> str | None:
        return None if text is None else filled(text, labels)

    return replace(
        source,
        labels={**row.labels, **labels, **source.labels},
        map=source.map or value(row.map),
        topics=source.topics or value(row.topics),
        robot=source.robot or value(row.robot),
    )
