"""The places of all maps, summed over logs as they are read: they need not fit into memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.fleet.answers import SPOT_M
from slamreplay.fleet.counted import Counted
from slamreplay.fleet.schema import PLACE_M
from slamreplay.geometry import se2

if TYPE_CHECKING:
    import pyarrow as pa

    from slamreplay.fleet.snapshot import Snapshot

#: A log looked at a place if its beams checked a quarter of it: less of it may lie behind a corner.
LOOK_M2 = 0.25 * PLACE_M**2
#: A log contradicts a place by five cells of 0.1 m. Racks that were moved for good in a simulated
#: hall made 0.08 to 0.24 m2 of a place, log after log; 24 logs of a hall that stayed as it was made
#: none anywhere.
AGAINST_M2 = 0.05
#: Edge of a spot in places.
SPOT = round(SPOT_M / PLACE_M)

#: Places of all maps are told apart by one number: so many bits of column and row, the rest is the
#: map's. That is 16,777 km each way, and more maps than anybody has in use.
_BITS = 24
_HALF = 1 << (_BITS - 1)
MOST_MAPS = 1 << (63 - 2 * _BITS)
#: Sums are merged when so many rows, or as many as there are sums, have come to them.
_MERGE_AT = 1 << 18

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sums:
    """Rows by code (of a place or a spot), ascending.

    Attributes:
        code: (N,) of the place or spot.
        added: (N, C) columns that add up.
        greatest: (N,) of the column whose greatest is wanted.
    """

    code: Ints
    added: se2.Array
    greatest: se2.Array

    def split(self) -> tuple[Ints, Ints, Ints]:
        """Map, column and row of each."""
        return split(self.code)

    def of_map(self, index: int) -> slice:
        """The rows of a map."""
        return of_map(self.code, index)


def split(code: Ints) -> tuple[Ints, Ints, Ints]:
    """Map, column and row of codes (N,)."""
    mask = (1 << _BITS) - 1
    return code >> (2 * _BITS), ((code >> _BITS) & mask) - _HALF, (code & mask) - _HALF


def of_map(code: Ints, index: int) -> slice:
    """The rows of a map among ascending codes (N,)."""
    ends = np.searchsorted(code, [index << (2 * _BITS), (index + 1) << (2 * _BITS)])
    return slice(int(ends[0]), int(ends[1]))


def coded(map_index: Ints, col: Ints, row: Ints) -> Ints:
    """One number for a place or spot of a map."""
    return (map_index << (2 * _BITS)) + ((col + _HALF) << _BITS) + (row + _HALF)


class Adding:
    """Sums that grow by rows of codes."""

    def __init__(self, columns: int) -> None:
        self._held: list[tuple[Ints, se2.Array, se2.Array]] = []
        self._rows = 0
        self._empty = (np.empty(0, dtype=np.int64), np.empty((0, columns)), np.empty(0))

    def add(self, code: Ints, added: se2.Array, greatest: se2.Array) -> None:
        """More rows (N,), (N, C) and (N,)."""
        self._held.append(_merged(code, added, greatest))
        self._rows += len(self._held[-1][0])
        if self._rows > max(_MERGE_AT, len(self._held[0][0])):
            self._merge()

    def sums(self) -> Sums:
        """All of them."""
        self._merge()
        return Sums(*self._held[0])

    def _merge(self) -> None:
        held = [self._empty, *self._held]
        code, added, greatest = (np.concatenate([part[k] for part in held]) for k in range(3))
        self._held = [_merged(code, added, greatest)]
        self._rows = 0  # of what is new since


def _merged(code: Ints, added: se2.Array, greatest: se2.Array) -> tuple[Ints, se2.Array, se2.Array]:
    if not len(code):
        return code, added, greatest
    order = np.argsort(code, kind="stable")
    code = code[order]
    first = starts(code)
    return (
        code[first],
        np.add.reduceat(added[order], first, axis=0),
        np.maximum.reduceat(greatest[order], first, axis=0),
    )


def starts(values: NDArray[Any]) -> Ints:
    """Where each run of equal values (N,) begins, N > 0."""
    return np.flatnonzero(np.append(True, values[1:] != values[:-1]))


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of `places` of whole logs.

    Attributes:
        log: (N,) of the counted logs.
        code: (N,) of the place.
        numbers: by column.
    """

    log: Ints
    code: Ints
    numbers: dict[str, se2.Array]

    def take(self, index: Any) -> Rows:
        """Some of them."""
        return Rows(
            self.log[index],
            self.code[index],
            {name: column[index] for name, column in self.numbers.items()},
        )


class Maps:
    """Maps by site and version, numbered as they are met."""

    def __init__(self, logs: Counted, names: Sequence[tuple[str | None, str]] = ()) -> None:
        self.names = list(names)
        self.left_out = 0
        self._known = {name: k for k, name in enumerate(names)}
        self._logs = logs
        site = {name: k for k, name in enumerate(dict.fromkeys(logs.texts["site"].tolist()))}
        self._sites = list(site)
        self._site = np.array([site[name] for name in logs.texts["site"].tolist()], dtype=np.int64)

    def _number(self, site: str | None, version: str) -> int:
        """The number of a map; -1 where there are too many."""
        found = self._known.get((site, version))
        if found is None:
            if len(self.names) >= MOST_MAPS:
                return -1
            found = self._known[site, version] = len(self.names)
            self.names.append((site, version))
        return found

    def rows(self, now: Snapshot, numbers: tuple[str, ...]) -> Iterator[Rows]:
        """The rows of `places` of logs that count, whole logs at a time.

        Args:
            now: the parts.
            numbers: columns that are wanted.
        """
        held: list[Rows] = []
        for rows in self._read(now, numbers):
            last = rows.log == rows.log[-1]
            cut = len(rows.log) - int(np.argmin(last[::-1])) if not last.all() else 0
            if cut:
                yield _joined([*held, rows.take(slice(0, cut))])
                held = []
            held.append(rows.take(slice(cut, None)))
        if held:
            yield _joined(held)

    def _read(self, now: Snapshot, numbers: tuple[str, ...]) -> Iterator[Rows]:
        import pyarrow as pa

        keys = pa.array(self._logs.texts["key"].tolist(), type=pa.string())
        columns = ("key", "map_version", "col", "row", *numbers)
        for table in now.tables("places", columns, coded=True):
            rows = self._numbered(table, keys, numbers)
            if len(rows.log):
                yield rows

    def _numbered(self, table: pa.Table, keys: pa.Array, numbers: tuple[str, ...]) -> Rows:
        import pyarrow.compute as pc

        key, versions = (table[name].combine_chunks() for name in ("key", "map_version"))
        known = pc.index_in(key.dictionary, value_set=keys).fill_null(-1).to_numpy()
        log = known[key.indices.to_numpy()].astype(np.int64)
        version = versions.indices.fill_null(-1).to_numpy().astype(np.int64)
        col, row = (table[name].to_numpy().astype(np.int64) for name in ("col", "row"))
        counts = (log >= 0) & (version >= 0)
        counts &= np.maximum(np.abs(col), np.abs(row)) < _HALF
        names = versions.dictionary.to_pylist()
        pairs, index = np.unique(
            self._site[log[counts]] * max(1, len(names)) + version[counts], return_inverse=True
        )
        found = np.array(
            [
                self._number(self._sites[pair // len(names)], names[pair % len(names)])
                for pair in pairs.tolist()
            ],
            dtype=np.int64,
        )
        map_index = np.full(len(log), -1)
        map_index[counts] = found[index]
        self.left_out += int(np.count_nonzero(counts & (map_index < 0)))
        keep = map_index >= 0
        return Rows(
            log[keep],
            coded(map_index[keep], col[keep], row[keep]),
            {name: table[name].to_numpy()[keep].astype(np.float64) for name in numbers},
        )


def _joined(held: list[Rows]) -> Rows:
    if len(held) == 1:
        return held[0]
    return Rows(
        np.concatenate([rows.log for rows in held]),
        np.concatenate([rows.code for rows in held]),
        {name: np.concatenate([rows.numbers[name] for rows in held]) for name in held[0].numbers},
    )
