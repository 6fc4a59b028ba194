"""From a log and a budget to the answer: ages, stages, the gate, loops, and the replayed check."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.bundle.view import Bundle
from slamreplay.errors import NotApplicableError
from slamreplay.geometry.times import ns
from slamreplay.labs.latency_budget.ask import Budget, Stage
from slamreplay.labs.latency_budget.gate import GateCurve, gate_curve
from slamreplay.labs.latency_budget.replayed import Checked, checked
from slamreplay.verdict.latency.ages import ages
from slamreplay.verdict.latency.consumers import Budgets, Consumer, Name, moving_times
from slamreplay.verdict.latency.gated import rooms
from slamreplay.verdict.latency.latency import Latency, Usage, latency, usages
from slamreplay.verdict.latency.stages import Blocked, Lag, Reach, behind, blocked
from slamreplay.verdict.limits import Limits

LOOPS: tuple[Name, ...] = ("controller", "planner")
_NONE = Stage.model_construct(name="none", stage_s=0.0)


@dataclass(frozen=True, eq=False)
class Staged:
    """A stage, and what it does to each consumer and loop; the first of all is none."""

    name: str
    stage_s: float
    lags: tuple[Lag, ...]
    loops: tuple[Blocked, ...]


@dataclass(frozen=True, eq=False)
class Answer:
    """All that a budget recipe found.

    Attributes:
        ask: what the recipe set.
        found: ages of what the log has of consumers, then of loops at the budget's rates, as if
            they had run while the robot moved.
        used: the same in a few numbers.
        stages: no stage first, then the recipe's.
        curve: the gate, None where there is no room to judge.
        checks: the formula against replayed estimators.
        start_ns: of the log.
    """

    ask: Budget
    found: Latency
    used: tuple[Usage, ...]
    stages: tuple[Staged, ...]
    curve: GateCurve | None
    checks: tuple[Checked, ...]
    start_ns: int


def answer(
    bundle: Bundle,
    ask: Budget,
    seed: int,
    progress: Callable[[str, float], None] | None = None,
    cache: Path | None = None,
) -> Answer:
    """The answer of a budget recipe to one log.

    Args:
        bundle: the log.
        ask: what the recipe sets.
        seed: of the replayed estimators.
        progress: told what is being done, and the share done.
        cache: folder of earlier runs.

    Raises:
        NotApplicableError: the log has neither a localizer nor odometry that moved.
    """
    view = bundle.view()
    budgets = Budgets(ask.controller_hz, ask.planner_hz)
    found = latency(view, budgets)
    track = found.track
    if track is None or not found.ages:
        raise NotApplicableError("the log has no odometry that moved: no pose has an age",
                                 where="budget")  # fmt: skip
    loops = {
        name: Consumer(name, None, moving_times(track, budgets.hz(name)), budgets.hz(name))
        for name in LOOPS
    }
    recorded = [a for a in found.ages if a.consumer.is_recorded]
    as_if = [ages(c, found.said, found.odometry) for c in loops.values() if len(c.t_ns)]
    whole = replace(found, ages=(*recorded, *as_if))
    users = [a.consumer for a in whole.ages if a.consumer.loop is not None or a in as_if]
    work_s = {a.consumer.name: a.consumer.work_s or 0.0 for a in recorded}
    staged = tuple(
        Staged(
            stage.name,
            stage.stage_s,
            tuple(behind(found, user, ns(stage.stage_s)) for user in users),
            tuple(blocked(c.budget_hz, stage.stage_s, work_s.get(c.name, 0.0))
                  for c in loops.values()),
        )
        for stage in (_NONE, *ask.stages)
    )  # fmt: skip
    reach, curve = Reach(ask.lever_m, ask.odometry_error_ratio), None
    fast = loops["controller"]
    belief = recorded_belief(view, belief_times(view))
    room = rooms(view, belief, Limits(), fast.t_ns) if found.said is not None else None
    if room is not None and len(room):
        curve = gate_curve(found, fast, room, ask.gate, reach)
    checks = checked(bundle, ask.replayed, ask.stages, seed, progress, cache)
    start_ns = view.manifest.start_ns
    return Answer(ask, whole, usages(whole), staged, curve, checks, start_ns)
