"""The answer of a design as files: results.json and results.md."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from slamreplay.doses.plan import Plan
from slamreplay.replay.dose import DoseResults
from slamreplay.replay.dose_ranking import ranking
from slamreplay.report.dose_tables import (
    Rows,
    control_rows,
    controls_hold,
    critical_rows,
    limit_rows,
    notes,
    panel_of,
    ranking_rows,
)

RESULTS, PAGE, RESULTS_FORMAT = "results.json", "results.md", 1


def results_json(plan: Plan, results: DoseResults, log: Mapping[str, Any]) -> str:
    """What was asked and what came out, curves by perturbation and estimator.

    Args:
        plan: what was asked.
        results: what came out.
        log: what it was asked of: bundle id, and the scenario where it was simulated.
    """
    curves: dict[str, dict[str, Any]] = {}
    for curve in results.curves:
        told = asdict(curve)
        told["critical"] = {c.pop("metric"): c for c in told["critical"]}
        curves.setdefault(panel_of(curve), {})[curve.estimator] = told
    content = {
        "results_format": RESULTS_FORMAT,
        "question": plan.question,
        "log": dict(log),
        "seeds": list(plan.seeds),
        "estimators": list(plan.estimators),
        "limits": {limit.metric: limit.at_most for limit in plan.limits},
        "results": {
            "judged_by": results.judged_by,
            "controls_hold": controls_hold(results.controls),
            "ranking": [asdict(margin) for margin in ranking(results)],
            "curves": curves,
            "controls": [asdict(control) for control in results.controls],
        },
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def results_page(results: DoseResults, figures: Sequence[str]) -> str:
    """The same for a reader, in Markdown.

    Args:
        results: of the design.
        figures: names of files without suffix.
    """
    lines = [f"# {results.question}", ""]
    for title, rows in tables(results):
        lines += [f"## {title}", "", *_markdown(rows), ""]
    lines += [*(f"- {note}" for note in notes(results)), METHOD]
    lines += [f"![{name}]({name}.png)" for name in figures]
    return "\n".join(lines) + "\n"


def tables(results: DoseResults) -> list[tuple[str, Rows]]:
    """Title and rows, the head first."""
    return [
        (f"Critical levels: {results.limits[0].title}", critical_rows(results)),
        ("Every limit", limit_rows(results)),
        ("What breaks first, by the share of the range tried", ranking_rows(results)),
        (f"Difference from the same seed undisturbed: {results.limits[0].metric}",
         _paired_rows(results)),
        ("Controls", control_rows(results.controls)),
    ]  # fmt: skip


#: What holds for every design.
METHOD = """\
- A critical level is the least level tried at which half of the seeds or more had crossed. Its
  interval is that of the median over seeds, between order statistics of the levels that held and of
  those that broke, with the confidence told; below six seeds 95 % cannot be had.
- Differences are those of one seed with and without; the interval of their mean is Student's.
- Shares of the range tried compare levels of different units only as far as the recipe's ranges do.
"""


def _paired_rows(results: DoseResults) -> Rows:
    metric = results.limits[0].metric
    rows = [["perturbation", "estimator", "level", "mean difference", "95 % interval", "n"]]
    for curve in results.curves:
        for response in curve.responses[1:]:
            found = response.paired.get(metric)
            if found is None:
                continue
            ends = f"{found.low:.3g} to {found.high:.3g}" if found.low is not None and (
                found.high is not None) else "-"  # fmt: skip
            rows.append([panel_of(curve), curve.estimator, f"{response.level:g} {curve.unit}",
                         f"{found.mean:.3g}", ends, str(found.n)])  # fmt: skip
    return rows


def _markdown(rows: Rows) -> list[str]:
    lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
    return [f"| {' | '.join(line)} |" for line in lines]
