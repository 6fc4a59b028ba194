"""The answer of a design as text: results.json, results.md and the rows of a table."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from slamreplay.doses.plan import Plan
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.dose import Control, Critical, DoseCurve, DoseResults
from slamreplay.replay.dose_ranking import Margin, ranking

RESULTS, PAGE, RESULTS_FORMAT = "results.json", "results.md", 1

Rows = list[list[str]]


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
    lines += [f"- {note}" for note in (*notes(results), *METHOD)] + [""]
    lines += [f"![{name}]({name}.png)" for name in figures]
    return "\n".join(lines) + "\n"


def tables(results: DoseResults) -> list[tuple[str, Rows]]:
    """Title and rows, the head first."""
    return [
        (f"Critical levels: {results.limits[0].title}", critical_rows(results)),
        ("Every limit", _limit_rows(results)),
        ("What breaks first, by the share of the range tried", ranking_rows(results)),
        (f"Difference from the same seed undisturbed: {results.limits[0].metric}",
         _paired_rows(results)),
        ("Controls", _control_rows(results.controls)),
    ]  # fmt: skip


def critical_rows(results: DoseResults) -> Rows:
    """A row for each curve: what a terminal has room for."""
    rows = [["perturbation", "unit", "estimator", "critical level", "broke first", "controls"]]
    for curve in results.curves:
        if curve.reason:
            rows.append([panel_of(curve), curve.unit, curve.estimator,
                         f"not applicable: {curve.reason}", "", ""])  # fmt: skip
            continue
        rows.append(
            [panel_of(curve), curve.unit, curve.estimator, level_text(curve.critical[0]),
             curve.broke_first or "nothing", _controls_of(curve, results.controls)]
        )  # fmt: skip
    return rows


def level_text(critical: Critical) -> str:
    """A critical level with its interval, or what there is instead."""
    low, high = _number(critical.low), _number(critical.high)
    if critical.outcome == "not_applicable":
        return "no such number"
    if critical.outcome == "always":
        return f"beyond it undisturbed ({critical.crossed} of {critical.seeds})"
    if critical.level is None:
        many = f"{critical.crossed} of {critical.seeds} seeds broke"
        return f"held up to {low}" if not critical.crossed else f"most held ({many})"
    if critical.confidence is None:
        return f"{critical.level:g} (held at {low})"
    to = f"to {high}" if critical.high is not None else "up"
    return f"{critical.level:g} [{low} {to}; {critical.confidence:.0%}]"


def ranking_rows(results: DoseResults) -> Rows:
    """The least margin first."""
    rows = [["estimator", "perturbation", "broke first", "at", "share of the range"]]
    return rows + [
        [m.estimator, m.perturbation, m.metric or "nothing", *_margin_cells(m)]
        for m in ranking(results)
    ]


def _margin_cells(margin: Margin) -> tuple[str, str]:
    if margin.level is None or margin.share is None:
        return "-", "held to its end"
    return f"{margin.level:g} {margin.unit}", f"{margin.share:.0%}"


def notes(results: DoseResults) -> list[str]:
    """Sentences that the numbers of this answer need, the failed controls first."""
    told = [warning(control) for control in results.controls if control.passed is False]
    told.append(_judges(results))
    by_note: dict[str, list[str]] = {}
    for curve in results.curves:
        for note in curve.notes:
            by_note.setdefault(note, []).append(f"{panel_of(curve)} with {curve.estimator}")
    return told + [f"{'; '.join(whose)}: {note}" for note, whose in by_note.items()]


#: What holds for every design.
METHOD = (
    (
        "A critical level is the least level tried at which half of the seeds or more had crossed. "
        "Its interval is that of the median over seeds, between order statistics of the levels "
        "that held and of those that broke, with the confidence told; below six seeds 95 % cannot "
        "be had."
    ),
    "Differences are those of one seed with and without; the interval of their mean is Student's.",
    (
        "Shares of the range tried compare levels of different units only as far as the ranges of "
        "the recipe do."
    ),
)


def warning(control: Control) -> str:
    """A failed control, so that nobody reads past it."""
    kind = "NO-OP CONTROL FAILED" if control.kind == "no_op" else "POSITIVE CONTROL FAILED"
    what = f"{control.perturbation} at {control.level:g} {control.unit}"
    return f"{kind}: {control.estimator}, {what}: {control.text}"


def controls_hold(controls: Sequence[Control]) -> bool:
    """Whether no control failed."""
    return all(control.passed is not False for control in controls)


def panel_of(curve: DoseCurve) -> str:
    """The perturbation; where it can go both ways, also which way it went."""
    if not curve.responses or curve.baseline == 0.0:
        return curve.perturbation
    way = "below" if curve.responses[-1].level < curve.baseline else "above"
    return f"{curve.perturbation} {way} {curve.baseline:g}"


def words_of(results: DoseResults) -> dict[str, str]:
    """By `NAME.VARIANT`, what a level does."""
    found = {}
    for curve in results.curves:
        name, _, variant = curve.perturbation.partition(".")
        found[curve.perturbation] = PERTURBATIONS.load(name).variants[variant].doc
    return found


def _judges(results: DoseResults) -> str:
    whose: dict[str, list[str]] = {}
    for curve in results.curves:
        names = whose.setdefault(curve.judged_by, [])
        if curve.estimator not in names:
            names.append(curve.estimator)
    told = "; ".join(f"{', '.join(names)} by {kind}" for kind, names in whose.items())
    own = " (baseline: its own undisturbed run, so that what is wrong in both does not show)"
    return f"errors are judged, nothing aligned: {told}{own if 'baseline' in whose else ''}"


def _controls_of(curve: DoseCurve, controls: Sequence[Control]) -> str:
    mine = [
        c
        for c in controls
        if c.estimator == curve.estimator
        and (c.kind == "positive" or c.perturbation == curve.perturbation)
    ]
    failed = [
        "NO-OP FAILED" if c.kind == "no_op" else "POSITIVE FAILED"
        for c in mine
        if c.passed is False
    ]
    unknown = [c.kind.replace("_", "-") for c in mine if c.passed is None]
    return ", ".join(failed) or (f"no {' nor '.join(unknown)}" if unknown else "hold")


def _limit_rows(results: DoseResults) -> Rows:
    rows = [["perturbation", "unit", "estimator", *(limit.title for limit in results.limits)]]
    return rows + [
        [panel_of(curve), curve.unit, curve.estimator, *(level_text(c) for c in curve.critical)]
        for curve in results.curves
        if not curve.reason
    ]


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


def _control_rows(controls: Sequence[Control]) -> Rows:
    rows = [["control", "estimator", "perturbation", "level", "held", "what was seen"]]
    held = {True: "yes", False: "NO", None: "-"}
    return rows + [
        [c.kind.replace("_", "-"), c.estimator, c.perturbation, f"{c.level:g} {c.unit}",
         held[c.passed], c.text]
        for c in controls
    ]  # fmt: skip


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


def _markdown(rows: Rows) -> list[str]:
    lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
    return [f"| {' | '.join(line)} |" for line in lines]
