"""When the age of a pose, or a loop that stalls, matters: by what the robot did in the meantime.

An age beyond the budget alone is no fault: 50 Hz are out of reach of odometry that comes at 25 Hz,
and a robot that creeps is where it was. What is told is the motion that the consumer did not know
of.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.verdict.latency.ages import motion_since
from slamreplay.verdict.latency.consumers import Consumer
from slamreplay.verdict.latency.latency import Latency, Usage
from slamreplay.verdict.limits import Limits

#: From here on a motion that nobody knew of is worth a word, as a jump of the belief is.
WORTH_M, WORTH_RAD = 0.2, np.radians(10.0)
#: So many periods, and at least so long, without a message are a stall.
STALL_PERIODS, STALL_S = 5.0, 0.25


def late_findings(found: Latency, used: tuple[Usage, ...], limits: Limits) -> tuple[Finding, ...]:
    """SR-LAT-001, poses that were too old, and SR-LAT-002, loops that stalled.

    Only loops are asked: keys that a person presses come when they come.

    Args:
        found: the log's ages.
        used: the same in a few numbers.
        limits: a motion beyond the limits of being lost is a warning, if somebody planned.
    """
    planned = any(a.consumer.name == "planner" and a.consumer.is_recorded for a in found.ages)
    out = []
    for usage in used:
        if usage.ages.consumer.loop is not None:
            out += _old(usage, limits, planned=planned)
            out += _stalled(found, usage.ages.consumer, limits, planned=planned)
    return tuple(out)


def _old(usage: Usage, limits: Limits, *, planned: bool) -> list[Finding]:
    way, turn, user = usage.unknown_m, usage.unknown_rad, usage.ages.consumer
    if usage.over is None or not usage.over[0] or way.p95 is None or turn.p95 is None:
        return []
    severity = _severity(way.p95, turn.p95, limits, planned=planned)
    if severity is None:
        return []
    text = (
        f"the {user.name} used poses that were {1e3 * (usage.pose.p50 or 0.0):.0f} ms old in the "
        f"median and {1e3 * (usage.pose.p95 or 0.0):.0f} ms in one of 20; in that time the robot "
        f"moved {way.p95:.2f} m and turned {np.degrees(turn.p95):.0f} deg, which the pose did not "
        f"say (budget: {1e3 * user.budget_s:.0f} ms)"
    )
    return [
        Finding(
            "SR-LAT-001", severity, text, int(user.t_ns[0]), int(user.t_ns[-1]),
            value=usage.pose.p95, low=0.0, high=user.budget_s, unit="s", n=usage.pose.n,
            n_eff=usage.pose.n_eff,
        )
    ]  # fmt: skip


def _stalled(found: Latency, user: Consumer, limits: Limits, *, planned: bool) -> list[Finding]:
    loop = user.loop
    if loop is None or loop.stall_s < max(STALL_S, STALL_PERIODS * loop.period_s):
        return []
    end_ns = loop.stall_ns + round(loop.stall_s * 1e9)
    step = motion_since(found.track, np.array([loop.stall_ns]), np.array([end_ns]))[0]
    way, turn = float(np.hypot(step[0], step[1])), float(abs(step[2]))
    severity = _severity(way, turn, limits, planned=planned) if np.isfinite(step).all() else None
    if severity is None:
        return []
    text = (
        f"the {user.name}, which comes round every {1e3 * loop.period_s:.0f} ms, said nothing for "
        f"{loop.stall_s:.2f} s while the robot moved {way:.2f} m and turned "
        f"{np.degrees(turn):.0f} deg"
    )
    return [
        Finding(
            "SR-LAT-002", severity, text, loop.stall_ns, end_ns, value=loop.stall_s, low=0.0,
            high=user.budget_s, unit="s", n=1,
        )
    ]  # fmt: skip


def _severity(
    way_m: float, turn_rad: float, limits: Limits, *, planned: bool
) -> Literal["info", "warning"] | None:
    if way_m < WORTH_M and turn_rad < WORTH_RAD:
        return None
    lost = way_m > limits.position_m or turn_rad > limits.yaw_rad
    return "warning" if lost and planned else "info"
