"""Which measurements moved the belief around a moment, those that moved it most first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.run import Innovations, Run, Trial
from slamreplay.consistency.belief.jumps.steps import sizes_of
from slamreplay.errors import UsageError
from slamreplay.geometry.times import NS_PER_S, ns

#: How far from the moment is looked; where nothing is that near, the nearest is told.
WINDOW_NS = 5 * NS_PER_S
#: Rows of one run in report.json; ledger.parquet has them all.
MOST_ROWS = 100


@dataclass(frozen=True, eq=False)
class Traced:
    """One row of a ledger."""

    set: Innovations
    row: int

    @property
    def t_ns(self) -> int:
        """When it was measured."""
        return int(self.set.t_ns[self.row])

    @property
    def metres(self) -> float:
        """How far it moved the belief, m; NaN where that is not known."""
        return float(np.hypot(*self.set.moved[self.row, :2]))

    @property
    def radians(self) -> float:
        """How far it turned the belief, without sign; NaN where that is not known."""
        return float(abs(self.set.moved[self.row, 2]))

    @property
    def sigma(self) -> tuple[float, ...]:
        """(m,) standard deviations of S; NaN where it has none."""
        variance = np.diagonal(self.set.S[self.row])
        return tuple(np.sqrt(np.where(variance >= 0.0, variance, np.nan)).tolist())

    @property
    def nis(self) -> float:
        """Normalised innovation squared."""
        return float(self.set.nis_of(np.array([self.row]))[0])


@dataclass(frozen=True, eq=False)
class RunTrace:
    """What moved one run's belief around a moment.

    Attributes:
        trial: the run's.
        rows: those within the window, the ones that moved it most first, then the nearest in time.
        near: whether any was within the window; else the one row is the nearest of all.
    """

    trial: Trial
    rows: tuple[Traced, ...]
    near: bool


def trace_time(trace_s: float, start_ns: int, end_ns: int) -> int:
    """The moment so many seconds after a log's start, ns.

    Raises:
        UsageError: it does not lie in the log.
    """
    length_s = (end_ns - start_ns) / NS_PER_S
    if not 0.0 <= trace_s <= length_s:
        raise UsageError(
            f"--trace {trace_s:g} is not within the log, which is {length_s:.1f} s long",
            hint="seconds after the log's start, as --start and the report have them",
        )
    return start_ns + ns(trace_s)


def trace(runs: Sequence[Run], t_ns: int) -> tuple[RunTrace, ...]:
    """One for each run that has a ledger."""
    traces = (_of_run(run, t_ns) for run in runs)
    return tuple(one for one in traces if one is not None)


def _of_run(run: Run, t_ns: int) -> RunTrace | None:
    sets = () if run.estimate is None else run.estimate.innovations
    rows, near = _around(sets, t_ns, WINDOW_NS), True
    if not rows:
        rows, near = _nearest(sets, t_ns), False
    return RunTrace(run.trial, tuple(rows[:MOST_ROWS]), near) if rows else None


def _around(sets: Sequence[Innovations], t_ns: int, window_ns: int) -> list[Traced]:
    found: list[tuple[float, int, int, int]] = []
    for k, one in enumerate(sets):
        rows = np.flatnonzero(np.abs(one.t_ns - t_ns) <= window_ns)
        size = np.nan_to_num(sizes_of(one.moved[rows]), nan=-1.0)
        apart = np.abs(one.t_ns[rows] - t_ns)
        found += zip((-size).tolist(), apart.tolist(), [k] * len(rows), rows.tolist(), strict=True)
    return [Traced(sets[k], row) for _, _, k, row in sorted(found)]


def _nearest(sets: Sequence[Innovations], t_ns: int) -> list[Traced]:
    apart = [int(np.abs(one.t_ns - t_ns).min()) for one in sets if len(one.t_ns)]
    return _around(sets, t_ns, min(apart))[:1] if apart else []
