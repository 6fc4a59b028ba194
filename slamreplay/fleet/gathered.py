"""What all logs say of the places of their maps: one way through the table that is the longest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slamreplay.fleet.cells import (
    AGAINST_M2,
    LOOK_M2,
    SPOT,
    Adding,
    Ints,
    Maps,
    Rows,
    Sums,
    coded,
    split,
    starts,
)
from slamreplay.fleet.counted import Counted, Flags
from slamreplay.geometry import se2

if TYPE_CHECKING:
    from slamreplay.fleet.snapshot import Snapshot

_TIMES = ("here_s", "lost_s", "entered_lost")
_SEEN = ("seen_m2", "contradicted_m2")
#: Columns of sums over places and over spots.
HERE, LOST, ENTERED, PASSED, LOST_LOGS, LOOKS, AGAINST = range(7)
SPOT_LOGS = LOST_LOGS


@dataclass(frozen=True, eq=False)
class Lost:
    """Where each log was lost.

    Attributes:
        log: (N,) log of each row.
        spot: (N,) at which it was lost, or became lost.
        lost_s: (N,) for how long.
        entered: (N,) how often it became lost there.
        place: (M,) places at which a log was lost, ascending.
        by: (M,) which log.
        by_s: (M,) for how long.
    """

    log: Ints
    spot: Ints
    lost_s: se2.Array
    entered: se2.Array
    place: Ints
    by: Ints
    by_s: se2.Array


@dataclass(frozen=True, eq=False)
class Gathered:
    """Sums over all logs.

    Attributes:
        maps: site and version of each map, by its number.
        places: columns HERE to AGAINST, and the greatest area that one log saw.
        spots: columns HERE to PASSED, and in how many logs the robot became lost there.
        lost: spots at which single logs were lost.
        left_out: rows of maps beyond the most that are told apart.
    """

    maps: tuple[tuple[str | None, str], ...]
    places: Sums
    spots: Sums
    lost: Lost
    left_out: int


def gathered(now: Snapshot, logs: Counted) -> Gathered:
    """Read all places once."""
    maps = Maps(logs)
    places, spots = Adding(7), Adding(5)
    lost: list[tuple[Ints, Ints, se2.Array, se2.Array]] = []
    at: list[tuple[Ints, Ints, se2.Array]] = []
    for rows in maps.rows(now, (*_TIMES, *_SEEN)):
        places.add(*_of_places(rows, logs))
        lost.append(_of_spots(rows, spots))
        was = rows.numbers["lost_s"] > 0
        at.append((rows.code[was], rows.log[was], rows.numbers["lost_s"][was]))
    none = np.empty(0, dtype=np.int64)
    empty = (none, none, np.empty(0), np.empty(0))
    log, spot, lost_s, entered = (
        np.concatenate([part[k] for part in (empty, *lost)]) for k in range(4)
    )
    place, by, by_s = (
        np.concatenate([part[k] for part in ((none, none, np.empty(0)), *at)]) for k in range(3)
    )
    order = np.lexsort((by, place))
    return Gathered(
        tuple(maps.names),
        places.sums(),
        spots.sums(),
        Lost(log, spot, lost_s, entered, place[order], by[order], by_s[order]),
        maps.left_out,
    )


def _of_places(rows: Rows, logs: Counted) -> tuple[Ints, se2.Array, se2.Array]:
    here_s, lost_s, entered = (rows.numbers[name] for name in _TIMES)
    looked, is_against = looks(rows, logs)
    added = [here_s, lost_s, entered, (here_s > 0) | (entered > 0), lost_s > 0, looked, is_against]
    return rows.code, np.column_stack(added).astype(np.float64), rows.numbers["seen_m2"]


def looks(rows: Rows, logs: Counted) -> tuple[Flags, Flags]:
    """Whether each row is a look at its place, and one that contradicts the map.

    Of logs with a verdict that can be put in order of time: what a place is like now is asked.
    """
    seen, contradicted = (rows.numbers[name] for name in _SEEN)
    counts = (logs.judged & logs.ordered)[rows.log]
    against = (contradicted >= AGAINST_M2) & counts
    return ((seen >= LOOK_M2) & counts) | against, against


def _of_spots(rows: Rows, spots: Adding) -> tuple[Ints, Ints, se2.Array, se2.Array]:
    """Add each log's passing of each spot; where it was lost is given back."""
    there = (rows.numbers["here_s"] > 0) | (rows.numbers["entered_lost"] > 0)
    rows = rows.take(there)
    if not len(rows.log):
        none = np.empty(0, dtype=np.int64)
        return none, none, np.empty(0), np.empty(0)
    index, col, row = split(rows.code)
    spot = coded(index, col // SPOT, row // SPOT)
    order = np.lexsort((spot, rows.log))
    spot, log = spot[order], rows.log[order]
    first = np.union1d(starts(spot), starts(log))
    sums = np.add.reduceat(
        np.column_stack([rows.numbers[name][order] for name in _TIMES]), first, axis=0
    )
    spot, log = spot[first], log[first]
    here_s, lost_s, entered = sums.T
    spots.add(
        spot,
        np.column_stack([here_s, lost_s, entered, np.ones(len(spot)), entered > 0]),
        lost_s,
    )
    was = (lost_s > 0) | (entered > 0)
    return log[was], spot[was], lost_s[was], entered[was]
