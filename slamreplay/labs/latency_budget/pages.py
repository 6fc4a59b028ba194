"""The answer as numbers, tables, sentences and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from slamreplay.geometry.times import NS_PER_S
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.labs.latency_budget.answer import Answer, Staged
from slamreplay.labs.latency_budget.gate import WAYS, GateAtStage, GateCurve, gate_at
from slamreplay.labs.latency_budget.replayed import Checked
from slamreplay.report.figures.latency_budget import (
    AgeCurve,
    GateLines,
    latency_budget_figure,
)
from slamreplay.report.latency import usage_part
from slamreplay.verdict.latency.consumers import Consumer
from slamreplay.verdict.latency.latency import Usage
from slamreplay.verdict.latency.spread import share_above, spread
from slamreplay.verdict.latency.stages import Lag, Reach

NOT_KNOWN = "-"
#: By whether odometry carries the pose.
_WAYS = {"held": "as it is", "carried": "carried by odometry"}


def results(answer: Answer) -> LabResults:
    """What goes to the folder and to the terminal."""
    reach = Reach(answer.ask.lever_m, answer.ask.odometry_error_ratio)
    gates = [
        None if answer.curve is None else gate_at(answer.curve, answer.found, s.stage_s, reach)
        for s in answer.stages
    ]
    clocks, said = answer.found.clocks, answer.found.said
    numbers: dict[str, Any] = {
        "basis": clocks.basis,
        "caveats": list(clocks.caveats),
        "localizer": None if said is None else said.source,
        "dated": None if said is None else said.dated,
        "ahead_s": None if said is None else said.lead_s,
        "consumers": [usage_part(usage).model_dump(mode="json") for usage in answer.used],
        "stages": [
            _stage(staged, gate, answer, reach)
            for staged, gate in zip(answer.stages, gates, strict=True)
        ],
        "gate": None if answer.curve is None else _gate(answer.curve),
        "replayed": [_check(check) for check in answer.checks],
    }
    tables = [
        _ages(answer.used),
        _stages(answer, reach),
        _loops(answer.stages),
        *([] if answer.curve is None else [_gated(answer, [g for g in gates if g])]),
        *([_replayed(answer.checks)] if answer.checks else []),
    ]
    return LabResults(
        numbers=_rounded(numbers),
        tables=tables,
        notes=[*_notes(answer), *(f"{c[0].upper()}{c[1:]}." for c in clocks.caveats)],
        figures={"latency_budget": lambda: _figure(answer)},
    )


def _name(user: Consumer) -> str:
    where = "as recorded" if user.is_recorded else f"as if at {user.budget_hz:g} Hz"
    return f"{user.name}, {where}"


def _ages(used: Sequence[Usage]) -> ResultTable:
    head = ("who used the pose", "uses", "rate [Hz]", "budget [ms]", "age of the pose [ms]",
            "over budget", "age of the correction [ms]", "of it scan, answer, waiting [ms]",
            "last new word [ms]", "longest pause [ms]", "moved meanwhile [m]")  # fmt: skip
    rows = []
    for usage in used:
        user, loop = usage.ages.consumer, usage.ages.consumer.loop
        parts = (usage.sensing_s, usage.answering_s, usage.waiting_s)
        rows.append((
            _name(user),
            f"{usage.pose.n}",
            NOT_KNOWN if loop is None else f"{1.0 / loop.period_s:.1f}",
            f"{1e3 * user.budget_s:.0f}",
            _three(usage.pose.p50, usage.pose.p95, usage.pose.most),
            _share(usage.over),
            _three(usage.correction.p50, usage.correction.p95, usage.correction.most),
            ", ".join(_ms(part) for part in parts),
            _three(usage.update.p50, usage.update.p95, usage.update.most),
            NOT_KNOWN if loop is None else _ms(loop.stall_s),
            _metres(usage.unknown_m.p95),
        ))  # fmt: skip
    brief = (head[0], head[2], head[3], head[4], head[5], head[6], head[10])
    return ResultTable("How old the pose was (median / 95 of 100 below / oldest)", head, rows,
                       brief)  # fmt: skip


def _stages(answer: Answer, reach: Reach) -> ResultTable:
    head = ("added stage", "who uses the pose", "age of the correction [ms]",
            "age of the pose [ms]", "over budget", "unknown as it is [m]",
            "unknown carried by odometry [m]")  # fmt: skip
    rows = [
        (
            _stage_name(staged),
            _name(lag.ages.consumer),
            _two(lag.ages.correction_s),
            _two(lag.ages.pose_s),
            _share(share_above(lag.ages.pose_s, lag.ages.consumer.budget_s)),
            _two_m(lag.held_m(reach)),
            _two_m(lag.carried_m(reach)),
        )
        for staged in answer.stages
        for lag in staged.lags
    ]
    return ResultTable("What a stage before the localizer's answer does (median / 95 of 100 below)",
                       head, rows)  # fmt: skip


def _loops(stages: Sequence[Staged]) -> ResultTable:
    head = ("stage that a loop waits for", "loop [Hz]", "own work [ms]", "of a cycle",
            "next cycle late by [ms]", "cycles missed", "rate left [Hz]")  # fmt: skip
    rows = [
        (_stage_name(staged), f"{b.loop_hz:g}", _ms(b.work_s), f"{100.0 * b.share:.0f} %",
         _ms(b.late_s), f"{b.missed}", f"{b.rate_hz:.1f}")
        for staged in stages
        if staged.stage_s
        for b in staged.loops
    ]  # fmt: skip
    return ResultTable("What it does to a loop that waits for it in each cycle", head, rows)


def _gated(answer: Answer, gates: Sequence[dict[Any, GateAtStage]]) -> ResultTable:
    curve = answer.curve
    assert curve is not None
    head = ("added stage", "pose is used", "moments allowed", "motions begun",
            "newly blocked", "first one blocked")  # fmt: skip
    alone = (
        "none, and no pose old", "", _percent(float(curve.alone.mean())),
        f"{int((curve.alone & curve.rooms.begins).sum())} of {int(curve.rooms.begins.sum())}",
        "", "",
    )  # fmt: skip
    rows = [alone]
    for staged, gate in zip(answer.stages, gates, strict=True):
        for way in WAYS:
            one = gate[way]
            rows.append((
                _stage_name(staged), _WAYS[way], _percent(one.allowed),
                f"{one.begins} of {int(curve.rooms.begins.sum())}", f"{one.blocked}",
                _first(one, curve, answer.start_ns),
            ))  # fmt: skip
    title = f"What the gate allows, of {len(curve.rooms)} moments: 3 sigma and the lag must fit"
    return ResultTable(title, head, rows)


def _first(one: GateAtStage, curve: GateCurve, start_ns: int) -> str:
    if one.first is None:
        return NOT_KNOWN
    k, rooms = one.first, curve.rooms
    return (
        f"at {(int(rooms.t_ns[k]) - start_ns) / NS_PER_S:.1f} s: 3 sigma "
        f"{3.0 * rooms.sigma_m[k]:.2f} m and {one.lag_m[k]:.2f} m of lag, "
        f"{rooms.clearance_m[k]:.2f} m of room"
    )


def _replayed(checks: Sequence[Checked]) -> ResultTable:
    head = ("estimator", "perturbation", "delay [ms]", "rows", "predicted [m]", "replayed [m]",
            "replayed / predicted", "left over, rms [m]")  # fmt: skip
    rows = [
        (c.estimator, c.perturbation, _ms(c.delay_s), f"{c.n}",
         *((_pair(c.predicted_m), _pair(c.replayed_m), f"{c.slope:.2f}", _metres(c.rest_m))
           if c.slope is not None else ("", "", "", c.reason or NOT_KNOWN)))
        for c in checks
    ]  # fmt: skip
    return ResultTable("The formula against a replay with that delay (median / 95 of 100 below)",
                       head, rows)  # fmt: skip


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
            f"{_WAYS[way]} {told}."
        )
    return notes


def _stage(
    staged: Staged, gate: dict[Any, GateAtStage] | None, answer: Answer, reach: Reach
) -> dict[str, Any]:
    return {
        "name": staged.name,
        "stage_s": staged.stage_s,
        "consumers": [_lag(lag, reach) for lag in staged.lags],
        "loops": [] if not staged.stage_s else [
            {"loop_hz": b.loop_hz, "work_s": b.work_s, "share": b.share, "late_s": b.late_s,
             "missed": b.missed, "rate_hz": b.rate_hz}
            for b in staged.loops
        ],
        "gate": None if gate is None or answer.curve is None else {
            way: _gate_numbers(gate[way], answer.curve, answer.start_ns) for way in WAYS
        },
    }  # fmt: skip


def _lag(lag: Lag, reach: Reach) -> dict[str, Any]:
    user = lag.ages.consumer
    over = share_above(lag.ages.pose_s, user.budget_s)
    held, carried = spread(lag.held_m(reach)), spread(lag.carried_m(reach))
    correction, pose = spread(lag.ages.correction_s), spread(lag.ages.pose_s)
    return {
        "name": user.name,
        "topic": user.topic,
        "hz": None if user.is_recorded else user.budget_hz,
        "correction_s": [correction.p50, correction.p95],
        "pose_s": [pose.p50, pose.p95],
        "over_share": None if over is None else over[0],
        "held_m": [held.p50, held.p95],
        "carried_m": [carried.p50, carried.p95],
    }


def _gate_numbers(one: GateAtStage, curve: GateCurve, start_ns: int) -> dict[str, Any]:
    k, rooms = one.first, curve.rooms
    first = None if k is None else {
        "t_s": (int(rooms.t_ns[k]) - start_ns) / NS_PER_S,
        "begins": bool(rooms.begins[k]),
        "sigma_m": float(rooms.sigma_m[k]),
        "clearance_m": float(rooms.clearance_m[k]),
        "lag_m": float(one.lag_m[k]),
    }  # fmt: skip
    return {"allowed_share": one.allowed, "begins": one.begins, "newly_blocked": one.blocked,
            "first_blocked": first}  # fmt: skip


def _gate(curve: GateCurve) -> dict[str, Any]:
    return {
        "moments": len(curve.rooms),
        "begins": int(curve.rooms.begins.sum()),
        "not_judged": curve.rooms.unknown,
        "allowed_share": float(curve.alone.mean()),
        "critical_s": dict(curve.critical_s),
        "stage_s": curve.stage_s.tolist(),
        "held_share": curve.held.tolist(),
        "carried_share": curve.carried.tolist(),
    }


def _check(check: Checked) -> dict[str, Any]:
    return {
        "estimator": check.estimator,
        "perturbation": check.perturbation,
        "delay_s": check.delay_s,
        "rows": check.n,
        "predicted_m": None if check.predicted_m is None else list(check.predicted_m),
        "replayed_m": None if check.replayed_m is None else list(check.replayed_m),
        "slope": check.slope,
        "rest_m": check.rest_m,
        "not_applicable": check.reason or None,
    }


def _figure(answer: Answer) -> Figure:
    curves = [
        AgeCurve(_name(u.ages.consumer), u.ages.consumer.name, u.ages.consumer.is_recorded,
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


def _rounded(value: Any) -> Any:
    """Four digits: what lies beyond is of no use, and differs between machines."""
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    if isinstance(value, float):
        return float(f"{value:.4g}") if np.isfinite(value) else None
    return value


def _stage_name(staged: Staged) -> str:
    return f"{staged.name}, {1e3 * staged.stage_s:.0f} ms" if staged.stage_s else staged.name


def _ms(seconds: float | None) -> str:
    return NOT_KNOWN if seconds is None or not np.isfinite(seconds) else f"{1e3 * seconds:.0f}"


def _metres(value: float | None) -> str:
    return NOT_KNOWN if value is None or not np.isfinite(value) else f"{value:.3f}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _share(told: tuple[float, float, float] | None) -> str:
    if told is None:
        return NOT_KNOWN
    share, low, high = (100.0 * v for v in told)
    return f"{share:.0f} % ({low:.0f} to {high:.0f})"


def _three(*values: float | None) -> str:
    return " / ".join(_ms(value) for value in values)


def _two(values: Any) -> str:
    told = spread(values)
    return f"{_ms(told.p50)} / {_ms(told.p95)}"


def _two_m(values: Any) -> str:
    told = spread(values)
    return f"{_metres(told.p50)} / {_metres(told.p95)}"


def _pair(values: tuple[float, float] | None) -> str:
    return NOT_KNOWN if values is None else " / ".join(_metres(v) for v in values)
