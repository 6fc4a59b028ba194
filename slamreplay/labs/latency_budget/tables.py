"""The answer as tables for people: one row a consumer, a stage, a loop or a replay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import NS_PER_S
from slamreplay.labs.lab import ResultTable
from slamreplay.labs.latency_budget.answer import Answer, Staged
from slamreplay.labs.latency_budget.gate import SIGMAS, WAYS, GateAtStage, GateCurve, Way
from slamreplay.labs.latency_budget.replayed import Checked
from slamreplay.verdict.latency.consumers import Consumer
from slamreplay.verdict.latency.latency import Usage
from slamreplay.verdict.latency.spread import share_above, spread
from slamreplay.verdict.latency.stages import Reach

NOT_KNOWN = "-"
#: By whether odometry carries the pose.
WAY_WORDS: dict[Way, str] = {"held": "as it is", "carried": "carried by odometry"}


def tables(
    answer: Answer, gates: Sequence[Mapping[Way, GateAtStage]], reach: Reach
) -> list[ResultTable]:
    """Ages, stages, loops, and what there is of the gate and of replays.

    Args:
        answer: all that was found.
        gates: what the gate makes of each stage; empty where it is not asked.
        reach: what turns motion into an error.
    """
    found = [_ages(answer.used), _stages(answer, reach), _loops(answer.stages)]
    if answer.curve is not None:
        found.append(_gated(answer, answer.curve, gates))
    if answer.checks:
        found.append(_replayed(answer.checks))
    return found


def consumer_name(user: Consumer) -> str:
    """Who it is, and whether the log has it or it runs as if it had been there."""
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
            consumer_name(user),
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
            consumer_name(lag.ages.consumer),
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


def _gated(
    answer: Answer, curve: GateCurve, gates: Sequence[Mapping[Way, GateAtStage]]
) -> ResultTable:
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
                _stage_name(staged), WAY_WORDS[way], _percent(one.allowed),
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
        f"at {(int(rooms.t_ns[k]) - start_ns) / NS_PER_S:.1f} s: {SIGMAS:g} sigma "
        f"{SIGMAS * rooms.sigma_m[k]:.2f} m and {one.lag_m[k]:.2f} m of lag, "
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


def _two(values: Array) -> str:
    told = spread(values)
    return f"{_ms(told.p50)} / {_ms(told.p95)}"


def _two_m(values: Array) -> str:
    told = spread(values)
    return f"{_metres(told.p50)} / {_metres(told.p95)}"


def _pair(values: tuple[float, float] | None) -> str:
    return NOT_KNOWN if values is None else " / ".join(_metres(v) for v in values)
