"""What became worse or better from one software version to the next."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slamreplay.fleet.answers import Share, Step
from slamreplay.fleet.counted import MEASURES, Counted, groups
from slamreplay.fleet.intervals import newcombe
from slamreplay.fleet.verdicts import Alike


def steps(logs: Counted, alike: Alike) -> tuple[Step, ...]:
    """Every measure over every pair of versions that follow each other, by pair, measure.

    Only sites that ran both versions are compared: another site is another world. Within these the
    mix of sites may still differ. Many intervals of 95 % are read at once: one in twenty is wrong.
    """
    rows = {name: found for name, found in groups(logs.texts["software"]) if name is not None}
    since = {name: logs.start_ns[found[logs.ordered[found]]] for name, found in rows.items()}
    dated = [name for name in rows if len(since[name])]  # others follow nobody
    order = sorted(dated, key=lambda name: (int(since[name].min()), name))
    kinds = sorted({*logs.cause[logs.judged].tolist()} - {None})
    return tuple(
        step
        for before, after in pairwise(order)
        for step in _between(logs, alike, (before, rows[before]), (after, rows[after]), kinds)
    )


def _between(
    logs: Counted,
    alike: Alike,
    before: tuple[str, NDArray[np.int64]],
    after: tuple[str, NDArray[np.int64]],
    kinds: list[str],
) -> Iterator[Step]:
    site = logs.texts["site"]
    both = {*site[before[1]].tolist()} & {*site[after[1]].tolist()}
    was_rows, now_rows = (
        rows[[one in both for one in site[rows].tolist()]] for _, rows in (before, after)
    )
    robots = logs.distinct("robot", np.append(was_rows, now_rows))
    for measure in (*MEASURES, *kinds):
        was, now = alike.share(measure, was_rows), alike.share(measure, now_rows)
        if measure in kinds and not was.count + now.count:
            continue
        low, high = _difference(alike, measure, (was, was_rows), (now, now_rows))
        yield Step(before[0], after[0], measure, was, now, low, high, len(both), robots)


def _difference(
    alike: Alike,
    measure: str,
    was: tuple[Share, NDArray[np.int64]],
    now: tuple[Share, NDArray[np.int64]],
) -> tuple[float | None, float | None]:
    told = alike.outcome(measure)[0]
    ends = []
    for share, rows in (was, now):
        if share.value is None:
            return None, None
        ends.append((share.value, alike.worth(measure, rows[told[rows]])))
    return newcombe(ends[0], ends[1])
