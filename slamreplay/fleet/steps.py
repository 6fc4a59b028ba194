"""What became worse or better from one software version to the next."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slamreplay.fleet.answers import Share, Step
from slamreplay.fleet.counted import MEASURES, Counted, groups
from slamreplay.fleet.intervals import effective_pair, newcombe
from slamreplay.fleet.verdicts import Alike


def steps(logs: Counted, alike: Alike) -> tuple[Step, ...]:
    """Every measure over every pair of versions that follow each other, by pair, measure.

    Only sites that ran both versions are compared: another site is another world. Within these the
    mix of sites may still differ. What is peculiar to a robot counts as far as it did not run both
    alike. Many intervals of 95 % are read at once: one in twenty is wrong.
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
        low, high = _difference(logs, alike, measure, (was, was_rows), (now, now_rows))
        yield Step(before[0], after[0], measure, was, now, low, high, len(both), robots)


def _difference(
    logs: Counted,
    alike: Alike,
    measure: str,
    was: tuple[Share, NDArray[np.int64]],
    now: tuple[Share, NDArray[np.int64]],
) -> tuple[float | None, float | None]:
    p, q = was[0].value, now[0].value
    if p is None or q is None:
        return None, None
    told, _, correlation = alike.outcome(measure)
    one, other = (logs.cluster[rows[told[rows]]] for rows in (was[1], now[1]))
    n, m = effective_pair(one, other, correlation)
    return newcombe((p, n), (q, m))
