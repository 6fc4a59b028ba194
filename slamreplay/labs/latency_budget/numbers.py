"""The answer as numbers for a machine: what `results.json` holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slamreplay.geometry.times import NS_PER_S
from slamreplay.labs.digits import four_digits
from slamreplay.labs.latency_budget.answer import Answer, Staged
from slamreplay.labs.latency_budget.gate import WAYS, GateAtStage, GateCurve, Way
from slamreplay.labs.latency_budget.replayed import Checked
from slamreplay.report.latency import usage_part
from slamreplay.verdict.latency.spread import share_above, spread
from slamreplay.verdict.latency.stages import Lag, Reach


def numbers(
    answer: Answer, gates: Sequence[Mapping[Way, GateAtStage]], reach: Reach
) -> dict[str, Any]:
    """Times in s, lengths in m, shares from 0 to 1; what is not known is None.

    Args:
        answer: all that was found.
        gates: what the gate makes of each stage; empty where it is not asked.
        reach: what turns motion into an error.
    """
    clocks, said = answer.found.clocks, answer.found.said
    asked: Sequence[Mapping[Way, GateAtStage] | None] = gates or [None] * len(answer.stages)
    found = {
        "basis": clocks.basis,
        "caveats": list(clocks.caveats),
        "localizer": None if said is None else said.source,
        "dated": None if said is None else said.dated,
        "ahead_s": None if said is None else said.lead_s,
        "consumers": [usage_part(usage).model_dump(mode="json") for usage in answer.used],
        "stages": [
            _stage(staged, gate, answer, reach)
            for staged, gate in zip(answer.stages, asked, strict=True)
        ],
        "gate": None if answer.curve is None else _gate(answer.curve),
        "replayed": [_check(check) for check in answer.checks],
    }
    return {key: _rounded(value) for key, value in found.items()}


def _stage(
    staged: Staged, gate: Mapping[Way, GateAtStage] | None, answer: Answer, reach: Reach
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


def _rounded(value: Any) -> Any:
    """The same with four digits, and None for what is not finite."""
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    if isinstance(value, float):
        return four_digits(value) if np.isfinite(value) else None
    return value
