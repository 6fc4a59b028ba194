"""The page's table of innovations: what each sensor measured against what a filter predicted."""

from __future__ import annotations

from slamreplay.bundle.run import Trial
from slamreplay.consistency.innovations.innovation_bias import bias_of, readable
from slamreplay.consistency.innovations.innovation_sets import InnovationSet, innovation_sets
from slamreplay.consistency.innovations.nis import nis_tests
from slamreplay.consistency.innovations.whiteness import LEAST, whiteness
from slamreplay.consistency.statistics.mean_test import MeanTest
from slamreplay.evidence.ledger import LEDGER_FILE
from slamreplay.evidence.result import Postmortem
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.phrases import NOT_KNOWN, number, percent

_HEAD = ("estimator", "sensor", "axis", "innovations", "used", "mean NIS [1]",
         "correlation of successive ones [1]", "measured minus predicted")  # fmt: skip


def innovations(post: Postmortem) -> Table:
    """A row for each axis of each sensor of the runs that nothing disturbed."""
    rows: list[list[str | Cell]] = []
    runs = [t.run for t in post.trials if t.run.trial.perturbation is None]
    seeds = {run.trial.seed for run in runs}
    for run in runs:
        if run.estimate is not None:
            for seen in innovation_sets(run.estimate.innovations):
                rows += _rows(_name(run.trial, len(seeds) > 1), seen)
    return table(_HEAD, rows, LEDGER_FILE)


def _name(trial: Trial, with_seed: bool) -> str:
    return f"{trial.estimator} (seed {trial.seed})" if with_seed else trial.estimator


def _rows(name: str, seen: InnovationSet) -> list[list[str | Cell]]:
    kept = seen.accepted
    used = percent(float(kept.mean())) if len(seen) else NOT_KNOWN
    if used != NOT_KNOWN and kept.all():
        used = "all"
    if kept.sum() < LEAST:
        first = Cell(f"{len(seen)}", "too few to judge")
        blank = [NOT_KNOWN] * 3
        return [[name, seen.source, axis, first, used, *blank] for axis in seen.axes]
    tests, correlation = nis_tests(seen), whiteness(seen.residual[kept] / seen.sigma[kept])
    rows: list[list[str | Cell]] = []
    for k, axis in enumerate(seen.axes):
        rho, bound = float(correlation.rho[k, 0]), 1.96 * float(correlation.error[k, 0])
        bias = bias_of(seen.residual[kept, k])
        unit, factor = readable(seen.units[k], bias.mean)
        low, high = factor * bias.low, factor * bias.high
        rows.append(
            [
                name,
                seen.source,
                axis,
                f"{len(seen)}",
                used,
                _nis(tests.axes[k]),
                Cell(number(rho), f"chance: within {bound:.2f}"),
                Cell(f"{factor * bias.mean:.3g}{unit}", f"95 %: {low:.3g} to {high:.3g}"),
            ]
        )
    return rows


def _nis(test: MeanTest) -> Cell:
    if test.mean is None or test.low is None or test.high is None:
        return Cell(NOT_KNOWN)
    return Cell(f"{test.mean:.3g}", f"chance: {test.low:.2f} to {test.high:.2f}")
