"""The gate of actions behind stages of growing length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import ns
from slamreplay.labs.latency_budget.ask import Gate
from slamreplay.verdict.latency.consumers import Consumer
from slamreplay.verdict.latency.gated import Rooms
from slamreplay.verdict.latency.latency import Latency
from slamreplay.verdict.latency.stages import Reach, behind
from slamreplay.verdict.limits import Limits

SIGMAS = Limits().gate_sigmas
#: Steps of the curve, and how finely the critical length is told.
STEPS, RESOLUTION_S = 30, 0.005

Way = Literal["held", "carried"]
WAYS: tuple[Way, ...] = ("held", "carried")


@dataclass(frozen=True, eq=False)
class GateCurve:
    """Shares of N moments that the gate allows, by the length of an added stage.

    Attributes:
        user: whose pose it is.
        rooms: the moments.
        alone: (N,) what 3 sigma alone allow, as if no pose were old.
        stage_s: (K,) lengths; the first is 0.
        held: (K,) share for poses that are used as they are.
        carried: (K,) share for poses that odometry carries on.
        critical_s: by way, the least length from which on less than the limit of those that 3 sigma
            alone allow are still allowed; None where no length does that.
        now: by way, (N,) what is allowed with the poses as old as they were.
    """

    user: Consumer
    rooms: Rooms
    alone: NDArray[np.bool_]
    stage_s: Array
    held: Array
    carried: Array
    critical_s: dict[Way, float | None]
    now: dict[Way, NDArray[np.bool_]]


def gate_curve(found: Latency, user: Consumer, rooms: Rooms, ask: Gate, reach: Reach) -> GateCurve:
    """The curve over moments, of which there is at least one.

    Args:
        found: the log's ages.
        user: whose pose it is.
        rooms: the moments.
        ask: the limit, and how far to go.
        reach: what turns motion into an error.
    """
    alone = rooms.allowed(0.0, SIGMAS)

    def allowed(stage_s: float) -> dict[Way, NDArray[np.bool_]]:
        lags = rooms.lags(behind(found, user, ns(stage_s)), reach)
        return {way: rooms.allowed(lag, SIGMAS) for way, lag in zip(WAYS, lags, strict=True)}

    stage_s = np.linspace(0.0, ask.longest_stage_s, STEPS + 1)
    every = [allowed(length) for length in stage_s.tolist()]
    shares = {way: np.array([one[way].mean() for one in every]) for way in WAYS}
    least = ask.still_allowed_ratio * float(alone.mean())
    critical: dict[Way, float | None] = {}
    for way in WAYS:
        few = np.flatnonzero(shares[way] < least)
        critical[way] = float(stage_s[few[0]]) if len(few) else None
        if len(few) and few[0]:
            low, high = float(stage_s[few[0] - 1]), float(stage_s[few[0]])
            while high - low > RESOLUTION_S:
                middle = 0.5 * (low + high)
                too_few = allowed(middle)[way].mean() < least
                low, high = (low, middle) if too_few else (middle, high)
            critical[way] = high
    return GateCurve(user, rooms, alone, stage_s, shares["held"], shares["carried"], critical,
                     every[0])  # fmt: skip


@dataclass(frozen=True)
class GateAtStage:
    """What the gate makes of one stage, for one way of using the pose.

    Attributes:
        allowed: share of the moments.
        begins: motions that may begin.
        blocked: moments that are allowed without it and not with it; of no stage, those that 3
            sigma alone allow and the age of the poses does not.
        first: row of the first of them, None without any.
        lag_m: (N,) towards the obstacle, for each moment.
    """

    allowed: float
    begins: int
    blocked: int
    first: int | None
    lag_m: Array


def gate_at(
    curve: GateCurve, found: Latency, stage_s: float, reach: Reach
) -> dict[Way, GateAtStage]:
    """What the gate makes of a stage, by how the pose is used."""
    rooms, out = curve.rooms, {}
    lags = rooms.lags(behind(found, curve.user, ns(stage_s)), reach)
    for way, lag in zip(WAYS, lags, strict=True):
        still = rooms.allowed(lag, SIGMAS)
        lost = np.flatnonzero((curve.now[way] if stage_s else curve.alone) & ~still)
        first = int(lost[0]) if len(lost) else None
        begins = int((still & rooms.begins).sum())
        out[way] = GateAtStage(float(still.mean()), begins, len(lost), first, lag)
    return out
