"""The answer as what a budget recipe leaves in its folder: numbers, tables, notes, a picture."""

from __future__ import annotations

from matplotlib.figure import Figure

from slamreplay.labs.lab import LabResults
from slamreplay.labs.latency_budget.answer import Answer
from slamreplay.labs.latency_budget.gate import WAYS, gate_at
from slamreplay.labs.latency_budget.numbers import numbers
from slamreplay.labs.latency_budget.tables import WAY_WORDS, consumer_name, tables
from slamreplay.report.figures.latency_budget import (
    AgeCurve,
    GateLines,
    latency_budget_figure,
)
from slamreplay.verdict.latency.stages import Reach


def results(answer: Answer) -> LabResults:
    """What goes to the folder and to the terminal."""
    reach, curve = Reach(answer.ask.lever_m, answer.ask.odometry_error_ratio), answer.curve
    gates = [] if curve is None else [
        gate_at(curve, answer.found, staged.stage_s, reach) for staged in answer.stages
    ]  # fmt: skip
    caveats = (f"{c[0].upper()}{c[1:]}." for c in answer.found.clocks.caveats)
    return LabResults(
        numbers=numbers(answer, gates, reach),
        tables=tables(answer, gates, reach),
        notes=[*_notes(answer), *caveats],
        figures={"latency_budget": lambda: _figure(answer)},
    )


def _notes(answer: Answer) -> list[str]:
    ask, curve = answer.ask, answer.curve
    ages = (
        "age of the pose: from the moment that tf could answer for until it was used; of the "
        "correction: from the moment its measurement was taken. A stamp in the future makes "
        "neither younger."
    )
    unknown = (
        f"unknown: the motion since, and its turn over a lever of {ask.lever_m:g} m; where "
        f"odometry carries the correction, {100.0 * ask.odometry_error_ratio:g} % of what it "
        "carried over, and the motion since the moment that tf could answer for."
    )
    stage = "a stage works on one answer at a time; what comes meanwhile is left out."
    notes = [ages, unknown, stage]
    if answer.checks:
        notes.append(
            "replayed / predicted is less than 1 where an estimator also believes the wheels, or "
            "was already moving when it got its first pose; rows at which under 5 mm are predicted "
            "are left out."
        )
    if curve is None:
        return [*notes, "the gate is not asked: no sigma, no clearance or no localizer."]
    for way in WAYS:
        at = curve.critical_s[way]
        told = (
            f"from a stage of {1e3 * at:.0f} ms on" if at is not None
            else f"by no stage up to {1e3 * ask.gate.longest_stage_s:.0f} ms"
        )  # fmt: skip
        notes.append(
            f"of the moments that 3 sigma alone allow, less than "
            f"{100.0 * ask.gate.still_allowed_ratio:g} % are left where the pose is used "
            f"{WAY_WORDS[way]} {told}."
        )
    return notes


def _figure(answer: Answer) -> Figure:
    curves = [
        AgeCurve(consumer_name(u.ages.consumer), u.ages.consumer.name, u.ages.consumer.is_recorded,
                 u.ages.pose_s, u.ages.correction_s)
        for u in answer.used
        if u.ages.consumer.loop is not None or not u.ages.consumer.is_recorded
    ]  # fmt: skip
    budgets = {"controller": 1.0 / answer.ask.controller_hz, "planner": 1.0 / answer.ask.planner_hz}
    stages = [(s.name, s.stage_s) for s in answer.stages if s.stage_s]
    curve, lines = answer.curve, None
    if curve is not None:
        alone = float(curve.alone.mean())
        lines = GateLines(curve.stage_s, curve.held, curve.carried, alone,
                          answer.ask.gate.still_allowed_ratio)  # fmt: skip
    return latency_budget_figure(curves, budgets, lines, stages)
