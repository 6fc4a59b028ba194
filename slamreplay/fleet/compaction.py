"""Many small parts laid together into few large ones, while others read, and whoever is killed.

A new part appears by one rename, with a name that counts before those it was made of; then these
vanish, each by one rename. In between their rows are there twice, the newer ones count, and they
are the same. Only rows that count are carried over, so a killed attempt is made good by the next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.fleet.damage import DamagedError, Warn, mend, quiet, set_aside
from slamreplay.fleet.parts import Part, parts_in, remove_part, write_part
from slamreplay.fleet.schema import TABLES
from slamreplay.fleet.snapshot import Snapshot, of_now, read_part, without

if TYPE_CHECKING:
    import pyarrow as pa

#: So many parts of one size are laid together: each row is written three times, at most.
FAN = 64
#: A part of so many logs is large enough: a hundred thousand logs are 25 of them.
MOST_LOGS = FAN * FAN


def compact(folder: Path, warn: Warn | None = None) -> None:
    """Leave large parts only, and no row that does not count: at the end of a run.

    Args:
        folder: of the batch.
        warn: told of each damaged part, in one line; it is set aside.

    Raises:
        OutputError: the folder cannot be written.
    """

    def look(now: Snapshot) -> None:
        _join(folder, now, lambda k, part: part.logs < MOST_LOGS or len(now.stale[k]) > 0)

    for line in mend(folder):
        (warn or quiet)(line)
    of_now(folder, look, warn)


def join_small(folder: Path, parts: Sequence[Part], warn: Warn | None = None) -> None:
    """Lay parts together wherever there are `FAN` of one size.

    Args:
        folder: of the batch.
        parts: those that there are.
        warn: as of `compact`.

    Raises:
        OutputError: the folder cannot be written.
    """
    while True:
        crowd = next((c for size in (1, FAN) if len(c := _of_size(parts, size)) >= FAN), None)
        if crowd is None:
            return

        def look(now: Snapshot, crowd: Sequence[Part] = crowd) -> None:
            names = {part.folder for part in crowd}
            _join(folder, now, lambda _k, part: part.folder in names)

        of_now(folder, look, warn)
        left = parts_in(folder)
        if len(left) >= len(parts):  # others do the same, or they are damaged
            return
        parts = left


def _of_size(parts: Sequence[Part], size: int) -> list[Part]:
    return [part for part in parts if size <= part.logs < size * FAN]


def _join(folder: Path, now: Snapshot, is_meant: Callable[[int, Part], bool]) -> None:
    meant = [(k, now.heads[k].num_rows) for k, part in enumerate(now.parts) if is_meant(k, part)]
    for positions in _shares(meant):
        if len(positions) > 1 or len(now.stale[positions[0]]):
            _lay_together(folder, now, positions)


def _shares(parts: Sequence[tuple[int, int]]) -> Iterator[list[int]]:
    """Positions of parts in shares that have `MOST_LOGS` logs or few more."""
    share: list[int] = []
    total = 0
    for position, logs in parts:
        share.append(position)
        total += logs
        if total >= MOST_LOGS:
            yield share
            share, total = [], 0
    if share:
        yield share


def _lay_together(folder: Path, now: Snapshot, positions: Sequence[int]) -> None:
    """One part instead of several; one that turns out to be damaged is set aside."""
    left = list(positions)
    while left:
        logs = sum(now.heads[k].num_rows for k in left)
        parts = [now.parts[k] for k in left]
        tables = {name: _rows(now, left, name) for name in TABLES}
        number = max(part.number for part in parts)
        joined = 1 + max(part.joined for part in parts if part.number == number)
        try:
            if logs:
                write_part(folder, tables, logs, number, joined)
        except DamagedError as error:
            (bad,) = (k for k in left if now.parts[k].folder == error.where.parent)
            for line in set_aside(folder, now.parts[bad], error):
                now.warn(line)
            left.remove(bad)
        else:
            for part in parts:
                remove_part(folder, part)
            return


def _rows(now: Snapshot, positions: Sequence[int], table: str) -> Iterator[pa.Table]:
    for k in positions:
        for found in read_part(now.parts[k], table):
            yield without(found, now.stale[k])
