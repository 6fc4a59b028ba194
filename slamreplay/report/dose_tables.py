"""The answer of a design as rows of text: a page, a terminal and a file share them."""

from __future__ import annotations

from collections.abc import Sequence

from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.dose import Control, Critical, DoseCurve, DoseResults
from slamreplay.replay.dose_ranking import Margin, ranking

#: Cells, the head first.
Rows = list[list[str]]


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
             broke_text(curve), _controls_of(curve, results.controls)]
        )  # fmt: skip
    return rows


def broke_text(curve: DoseCurve) -> str:
    """What broke first; "nothing more" where limits are crossed undisturbed and no other later."""
    already = any(critical.outcome == "always" for critical in curve.critical)
    return curve.broke_first or ("nothing more" if already else "nothing")


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


def limit_rows(results: DoseResults) -> Rows:
    """A row for each curve, a column for each limit."""
    rows = [["perturbation", "unit", "estimator", *(limit.title for limit in results.limits)]]
    return rows + [
        [panel_of(curve), curve.unit, curve.estimator, *(level_text(c) for c in curve.critical)]
        for curve in results.curves
        if not curve.reason
    ]


def ranking_rows(results: DoseResults) -> Rows:
    """The least margin first."""
    rows = [["estimator", "perturbation", "broke first", "at", "share of the range"]]
    return rows + [
        [m.estimator, m.perturbation, m.metric or ("nothing more" if m.undisturbed else "nothing"),
         *_margin_cells(m)]
        for m in ranking(results)
    ]  # fmt: skip


def _margin_cells(margin: Margin) -> tuple[str, str]:
    if margin.level is None or margin.share is None:
        return "-", _held_text(margin)
    return f"{margin.level:g} {margin.unit}", f"{margin.share:.0%}"


def _held_text(margin: Margin) -> str:
    if margin.undisturbed:
        return f"beyond it undisturbed: {', '.join(margin.undisturbed)}"
    if margin.is_partly:
        return "most seeds held"
    if margin.held_to is None or margin.is_whole:
        return "held to its end"
    return f"held up to {margin.held_to:g} {margin.unit}: farther out there is no number"


def control_rows(controls: Sequence[Control]) -> Rows:
    """A row for each control."""
    rows = [["control", "estimator", "perturbation", "level", "held", "what was seen"]]
    held = {True: "yes", False: "NO", None: "-"}
    return rows + [
        [c.kind.replace("_", "-"), c.estimator, c.perturbation, f"{c.level:g} {c.unit}",
         held[c.passed], c.text]
        for c in controls
    ]  # fmt: skip


def notes(results: DoseResults) -> list[str]:
    """Sentences that the numbers of this answer need, the failed controls first."""
    told = [warning(control) for control in results.controls if control.passed is False]
    told += _judges(results)
    by_note: dict[str, list[str]] = {}
    for curve in results.curves:
        for note in curve.notes:
            by_note.setdefault(note, []).append(f"{panel_of(curve)} with {curve.estimator}")
    return told + [f"{'; '.join(whose)}: {note}" for note, whose in by_note.items()]


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
    """By `NAME.VARIANT`, what a level does; empty of one that is not installed here."""
    found = {}
    for curve in results.curves:
        name, _, variant = curve.perturbation.partition(".")
        known = PERTURBATIONS.load(name).variants if name in PERTURBATIONS else {}
        found[curve.perturbation] = known[variant].doc if variant in known else ""
    return found


def _judges(results: DoseResults) -> list[str]:
    """What the metrics of the limits are held against, each kind in a sentence."""
    asked = {limit.metric.partition("_")[0] for limit in results.limits}
    found = []
    if asked & {"error", "lost", "nees", "reference", "hindsight"}:
        found.append(_judged(results))
    if "baseline" in asked:
        found.append("distances from the baseline are from the estimator's own undisturbed run, so "
                     "that what is wrong in both does not show")  # fmt: skip
    if "ate" in asked:
        found.append("the aligned trajectory error is held against the log's own reference, in "
                     "whatever frame, after the whole path was laid onto it")  # fmt: skip
    if "relations" in asked:
        found.append("relations are held against those that were given: no frame, no start")
    return found


def _judged(results: DoseResults) -> str:
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


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"
