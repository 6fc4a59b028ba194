"""What became worse or better from one software version to the next."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slamreplay.fleet.answers import LEAST_LOGS, Share, Step
from slamreplay.fleet.counted import MEASURES, Counted, groups
from slamreplay.fleet.intervals import effective_pair, newcombe, z_of
from slamreplay.fleet.verdicts import Alike


def steps(logs: Counted, alike: Alike) -> tuple[Step, ...]:
    """Every measure over every pair of versions that follow each other, by pair, measure.

    Only sites that ran both versions are compared: another site is another world. Within these the
    mix of sites may still differ. What is peculiar to a robot counts as far as it did not run both
    alike. All measures of a change are read at once: their intervals hold together with 95 %.
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
    sites = {*site[before[1]].tolist()} & {*site[after[1]].tolist()}
    was_rows, now_rows = (
        rows[[one in sites for one in site[rows].tolist()]] for _, rows in (before, after)
    )
    robots = logs.distinct("robot", np.append(was_rows, now_rows))
    shares = {
        measure: (alike.share(measure, was_rows), alike.share(measure, now_rows))
        for measure in (*MEASURES, *kinds)
    }
    told = {m: both for m, both in shares.items() if m in MEASURES or any(s.count for s in both)}
    z = z_of(max(1, sum(min(s.n for s in both) >= LEAST_LOGS for both in told.values())))
    for measure, (was, now) in told.items():
        low, high = _difference(logs, alike, measure, (was, was_rows), (now, now_rows), z)
        yield Step(before[0], after[0], measure, was, now, low, high, len(sites), robots)


def _difference(
    logs: Counted,
    alike: Alike,
    measure: str,
    was: tuple[Share, NDArray[np.int64]],
    now: tuple[Share, NDArray[np.int64]],
    z: float,
) -> tuple[float | None, float | None]:
    p, q = was[0].value, now[0].value
    if p is None or q is None:
        return None, None
    told, _, correlation = alike.outcome(measure)
    one, other = (logs.cluster[rows[told[rows]]] for rows in (was[1], now[1]))
    n, m = effective_pair(one, other, correlation)
    return newcombe((p, n), (q, m), z)
