"""The design of a report's trials: what was changed, how much it took, what broke first."""

from __future__ import annotations

from slamreplay.evidence.result import Postmortem
from slamreplay.replay.dose import Critical, DoseCurve, DoseResults
from slamreplay.replay.dose_ranking import Margin, ranking
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.dose_tables import (
    broke_text,
    control_rows,
    level_text,
    notes,
    panel_of,
    ranking_rows,
    words_of,
)
from slamreplay.report.model import (
    ControlPart,
    CriticalPart,
    CurvePart,
    DesignPart,
    LimitPart,
    MarginPart,
)
from slamreplay.report.phrases import short
from slamreplay.report.trial_curves import curves_of_trials


def design_of(post: Postmortem) -> DoseResults | None:
    """The design that the trials were laid out by, else what can be read from them."""
    return post.design if post.design is not None else curves_of_trials(post)


def design_table(results: DoseResults | None) -> Table:
    """A row for each perturbation and estimator."""
    metric = "" if results is None else results.limits[0].metric
    head = ("what was changed", "estimator", f"{metric}, undisturbed", "at the end",
            "how much it took", "broke first")  # fmt: skip
    if results is None:
        return table(head, [])
    words, told = words_of(results), set[str]()
    rows: list[list[str | Cell]] = []
    for curve in results.curves:
        # What a level does is said once for all estimators.
        what = Cell(panel_of(curve), "" if panel_of(curve) in told else words[curve.perturbation])
        told.add(panel_of(curve))
        if curve.reason:
            rows.append([what, curve.estimator, Cell("not applicable", curve.reason), "", "", ""])
            continue
        first, last = curve.responses[0], curve.responses[-1]
        rows.append(
            [
                what,
                curve.estimator,
                _value(first.values.get(metric)),
                Cell(_value(last.values.get(metric)), f"at {last.level:g} {curve.unit}"),
                Cell(_took(curve), _interval(curve.critical[0])),
                broke_text(curve),
            ]
        )
    return table(head, rows, "doses.json of the runs")


def ranking_table(results: DoseResults | None) -> Table:
    """What broke at the least share of the range tried, first."""
    head = ("estimator", "what was changed", "broke first", "at", "share of the range tried")
    if results is None or len(results.curves) < 2:
        return table(head, [])
    titles = {limit.metric: limit.title for limit in results.limits}
    rows = [[*row[:2], titles.get(row[2], row[2]), *row[3:]] for row in ranking_rows(results)[1:]]
    return table(head, rows, "doses.json of the runs")


def control_table(results: DoseResults | None) -> Table:
    """Trials whose answer was known beforehand."""
    rows = [] if results is None else control_rows(results.controls)
    head = rows[0] if rows else ["control"]
    return table(tuple(head), rows[1:], "doses.json of the runs")


def design_notes(results: DoseResults | None) -> tuple[str, ...]:
    """What a reader of the numbers must know, failed controls first."""
    if results is None:
        return ()
    told = [_sentence(note) for note in notes(results)]
    if not results.controls:
        told.append(
            "These trials had no controls and one seed: a recipe adds both, and searches for the "
            "level at which a limit is crossed"
        )
    return tuple(f"{note}." for note in told)


def _sentence(note: str) -> str:
    """With a capital, unless it begins with a name."""
    is_name = bool(set(note.partition(" ")[0]) & set("._"))
    return note if is_name else note[0].upper() + note[1:]


def design_alt(results: DoseResults | None) -> str:
    """The picture in words."""
    if results is None:
        return ""
    names = list(dict.fromkeys(panel_of(curve) for curve in results.curves))
    return (
        f"A panel for each of {', '.join(names)}: {results.limits[0].metric.replace('_', ' ')} "
        "against the level, a line for each estimator, the limit dashed."
    )


def design_part(results: DoseResults | None) -> DesignPart | None:
    """The key `design` of report.json."""
    if results is None:
        return None
    return DesignPart(
        question=results.question,
        judged_by=results.judged_by,
        seeds=list(results.seeds),
        limits=[LimitPart(metric=x.metric, at_most=x.at_most) for x in results.limits],
        curves=[_curve_part(curve) for curve in results.curves],
        controls=[
            ControlPart(
                kind=c.kind, estimator=c.estimator, perturbation=c.perturbation, level=c.level,
                unit=c.unit, passed=c.passed, text=c.text,
            )
            for c in results.controls
        ],
        ranking=[_margin_part(margin) for margin in ranking(results)],
    )  # fmt: skip


def _curve_part(curve: DoseCurve) -> CurvePart:
    return CurvePart(
        estimator=curve.estimator,
        perturbation=curve.perturbation,
        unit=curve.unit,
        baseline=curve.baseline,
        levels=[response.level for response in curve.responses[1:]],
        critical=[_critical_part(c) for c in curve.critical],
        broke_first=curve.broke_first,
        reason=curve.reason,
    )


def _critical_part(c: Critical) -> CriticalPart:
    return CriticalPart(
        metric=c.metric, outcome=c.outcome, level=c.level, low=c.low, high=c.high,
        confidence=c.confidence, crossed=c.crossed, seeds=c.seeds,
    )  # fmt: skip


def _margin_part(m: Margin) -> MarginPart:
    return MarginPart(
        estimator=m.estimator, perturbation=m.perturbation, unit=m.unit, metric=m.metric,
        level=m.level, share=m.share,
    )  # fmt: skip


def _took(curve: DoseCurve) -> str:
    critical = curve.critical[0]
    if critical.outcome == "crossed" and critical.level is not None:
        return f"{critical.level:g} {curve.unit}"
    if critical.outcome == "always":
        return "nothing: broken already"
    return level_text(critical)


def _interval(critical: Critical) -> str:
    if critical.outcome != "crossed" or critical.low is None:
        return ""
    if critical.confidence is None:
        return f"held at {critical.low:g}"
    high = "up" if critical.high is None else f"to {critical.high:g}"
    return f"{critical.low:g} {high} over {critical.seeds} seeds ({critical.confidence:.0%})"


def _value(values: tuple[float | None, ...] | None) -> str:
    """The middle one of the seeds'."""
    known = sorted(v for v in values or () if v is not None)
    return short(known[len(known) // 2]) if known else short(None)
