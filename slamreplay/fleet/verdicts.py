"""Verdicts counted by robot, site, map version, software version and day, with their intervals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from slamreplay.consistency.statistics.shares import wilson
from slamreplay.fleet.answers import DIMENSIONS, Dimension, Group, Rate, Share
from slamreplay.fleet.counted import Counted, Flags, groups
from slamreplay.fleet.intervals import (
    dispersion,
    effective,
    garwood,
    intraclass_correlation,
)
from slamreplay.geometry import se2
from slamreplay.verdict.judgement import STATES

_S_PER_H, _M_PER_KM = 3600.0, 1000.0

Rows = NDArray[np.int64]


class Alike:
    """How much alike logs of one robot are, asked once per measure."""

    def __init__(self, logs: Counted) -> None:
        self._logs = logs
        self._known: dict[str, tuple[Flags, Flags, float]] = {}

    def outcome(self, measure: str) -> tuple[Flags, Flags, float]:
        """As of `Counted`, and the intraclass correlation over all logs that tell of it."""
        if measure not in self._known:
            told, yes = self._logs.outcome(measure)
            found = intraclass_correlation(yes[told], self._logs.cluster[told])
            self._known[measure] = (told, yes, found)
        return self._known[measure]

    def worth(self, measure: str, rows: Rows) -> float:
        """How many independent logs these are worth."""
        return effective(self._logs.cluster[rows], self.outcome(measure)[2])

    def share(self, measure: str, rows: Rows, *, of_one_robot: bool = False) -> Share:
        """Of the logs among these that tell of an outcome, those in which it is so.

        Of one robot the question is how it fares itself, not what other robots would: its logs
        count in full.
        """
        told, yes, _ = self.outcome(measure)
        rows = rows[told[rows]]
        if not len(rows):
            return Share(0, 0, None, None)
        count = int(yes[rows].sum())
        n = len(rows) if of_one_robot else self.worth(measure, rows)
        return Share(count, len(rows), *wilson(count / len(rows), n))


def verdicts(logs: Counted, alike: Alike) -> tuple[Group, Mapping[Dimension, tuple[Group, ...]]]:
    """All logs as one group, and groups by each dimension."""
    counting = _Counting(logs, alike)
    total = counting.group(None, np.arange(len(logs)), of_one_robot=False)
    return total, {
        dimension: tuple(
            counting.group(
                None if name is None else str(name), rows, of_one_robot=dimension == "robot"
            )
            for name, rows in groups(logs.day if dimension == "day" else logs.texts[dimension])
        )
        for dimension in DIMENSIONS
    }


class _Counting:
    def __init__(self, logs: Counted, alike: Alike) -> None:
        self._logs = logs
        self._alike = alike
        numbers = logs.numbers
        self._times = numbers["lost_times"]
        self._km, self._h = numbers["driven_m"] / _M_PER_KM, numbers["judged_s"] / _S_PER_H
        # Of whole robots, and of logs of one robot, by each exposure.
        self._spread = [
            (between_robots(self._times, e, logs.cluster), within(self._times, e, logs.cluster))
            for e in (self._km, self._h)
        ]

    def group(self, name: str | None, rows: Rows, *, of_one_robot: bool) -> Group:
        logs, alike = self._logs, self._alike
        state = logs.texts["state"][rows].tolist()
        lost, changed, gate = (
            alike.share(measure, rows, of_one_robot=of_one_robot)
            for measure in ("lost", "changed", "gate")
        )
        per_km, per_h = (
            _rate(self._times[rows], exposure[rows], spread[1 if of_one_robot else 0])
            for exposure, spread in zip((self._km, self._h), self._spread, strict=True)
        )
        days = [day for day in logs.day[rows].tolist() if day is not None]
        return Group(
            name=name,
            logs=len(rows),
            failed=int(logs.failed[rows].sum()),
            states={one: state.count(one) for one in STATES},
            robots=logs.distinct("robot", rows),
            sites=logs.distinct("site", rows),
            lost=lost,
            changed=changed,
            gate_failed=gate,
            judged_h=float(self._h[rows].sum()),
            driven_km=float(self._km[rows].sum()),
            lost_h=float(logs.numbers["lost_s"][rows].sum()) / _S_PER_H,
            changed_h=float(logs.numbers["changed_s"][rows].sum()) / _S_PER_H,
            lost_per_km=per_km,
            lost_per_h=per_h,
            stops=int(logs.numbers["stops"][rows].sum()),
            first_day=min(days, default=None),
            last_day=max(days, default=None),
        )


def _rate(events: se2.Array, exposure: se2.Array, spread: float) -> Rate:
    count, total = int(events.sum()), float(exposure.sum())
    if total <= 0:
        return Rate(count, total, None, None)
    return Rate(count, total, *garwood(count / spread, total / spread))


def between_robots(events: se2.Array, exposure: se2.Array, cluster: Rows) -> float:
    """Dispersion of the robots' counts (N logs of theirs) about one common rate."""
    _, index = np.unique(cluster, return_inverse=True)
    counts, sums = (
        np.bincount(index, weights=what).astype(np.float64) for what in (events, exposure)
    )
    total = float(sums.sum())
    return dispersion(counts, sums * (float(counts.sum()) / total), 1) if total > 0 else 1.0


def within(events: se2.Array, exposure: se2.Array, cluster: Rows) -> float:
    """Dispersion of the logs' counts (N,) about the rates of their robots."""
    _, index = np.unique(cluster, return_inverse=True)
    counts, sums = (
        np.bincount(index, weights=what).astype(np.float64) for what in (events, exposure)
    )
    rate = np.divide(counts, sums, out=np.zeros_like(counts), where=sums > 0)
    ever = np.unique(index[events > 0])
    return dispersion(events, exposure * rate[index], len(ever))
