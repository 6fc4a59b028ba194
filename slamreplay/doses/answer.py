"""The rounds of a design: baselines, then all ladders and controls at once, then the searches."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.view import Bundle
from slamreplay.doses.chance import draws
from slamreplay.doses.controls import next_positive, no_op, no_op_of, positive, positive_doses
from slamreplay.doses.curves import broken, curve, dose_of, no_curve
from slamreplay.doses.judge import Judges
from slamreplay.doses.plan import Axis, Plan
from slamreplay.doses.search import next_levels
from slamreplay.doses.trials import Trials
from slamreplay.replay.dose import Control, DoseCurve, DoseResults
from slamreplay.replay.run_cache import run_file
from slamreplay.replay.runner import Replayer
from slamreplay.replay.watch import Watch

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Answer:
    """What a design found.

    Attributes:
        results: the curves, and whether the controls held.
        runs: those of the first seed, without the controls: baselines, then levels.
        trials: how many were replayed or found in the cache, controls included.
    """

    results: DoseResults
    runs: tuple[Run, ...]
    trials: int


@dataclass(frozen=True)
class _Pair:
    """One estimator and one perturbation.

    Attributes:
        estimator: whose.
        axis: which.
        seeds: of the trials.
        baseline_seeds: of their baselines, the first one's where all are the same.
        is_random: whether anything is drawn.
    """

    estimator: str
    axis: Axis
    seeds: tuple[int, ...]
    baseline_seeds: tuple[int, ...]
    is_random: bool


def answer(
    bundle: Bundle,
    plan: Plan,
    *,
    parameters: Mapping[str, str] = MappingProxyType({}),
    cache: Path | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
) -> Answer:
    """Replay what a design asks for, measure it, and say what broke first.

    Every round goes to the runner as one batch, over all seeds and curves. What draws no random
    number is replayed with the first seed alone.

    Args:
        bundle: the log.
        plan: what is asked.
        parameters: canonical JSON by estimator, for those that do not run with their defaults.
        cache: folder of what was computed earlier: runs and hindsight.
        workers: processes that share the trials, one per core by default.
        progress: told what is being done, and the share done.
        watch: told where every trial stands, for whoever looks on.

    Raises:
        UsageError: a trial names what does not exist, or a level that a perturbation refuses.
    """
    runs = None if cache is None else cache / "runs"
    judges = Judges(bundle, None if cache is None else cache / "hindsight", progress)
    with Replayer(bundle, cache=runs, workers=workers, watch=watch) as replayer:
        numbers = None if cache is None else cache / "numbers"
        trials = Trials(bundle, parameters, plan.seeds[0], judges, replayer, numbers)
        if runs is not None and bundle.path is not None:
            # Kept there, they are found below; cores that wait for baselines would be idle.
            ahead = [t for t in _foreseen(plan, trials) if not run_file(t, runs).is_file()]
            replayer.replay(ahead, progress=_share_of(progress, 0, len(ahead), plan.most_trials))
        return _answered(bundle, plan, trials, progress)


def _foreseen(plan: Plan, trials: Trials) -> list[Trial]:
    """Trials of the first seed that are asked for whatever the baselines say.

    In vain where an estimator has no pose undisturbed.
    """
    seed, found = plan.seeds[0], []
    for estimator in plan.estimators:
        doses = [dose_of(axis, v) for axis in plan.axes for v in (axis.baseline, *axis.levels)]
        found.append(trials.baseline(estimator, seed))
        found += [trials.dosed(estimator, seed, d) for d in (*doses, positive_doses(plan)[0])]
    return found


def _answered(bundle: Bundle, plan: Plan, trials: Trials, progress: Progress | None) -> Answer:
    trials.ask((trials.baseline(e, s) for e in plan.estimators for s in plan.seeds[:2]), progress)
    pairs = _pairs(bundle, plan, trials)
    levels: dict[_Pair, dict[float, None]] = {pair: {} for pair in pairs}
    wanted = {trials.baseline(p.estimator, seed): None for p in pairs for seed in p.baseline_seeds}
    wanted |= {trials.dosed(p.estimator, plan.seeds[0], no_op_of(p.axis)): None for p in pairs}
    most = trials.known + len(wanted) + sum(len(p.seeds) * p.axis.most_levels for p in pairs)
    while True:
        wanted |= dict.fromkeys(_positives(trials, plan, pairs))
        wanted |= dict.fromkeys(_next(trials, plan, levels))
        fresh = [trial for trial in wanted if trials.numbers(trial) is None]
        if not fresh:
            break
        trials.ask(fresh, _share_of(progress, trials.known, len(fresh), most))
        wanted = {}
    results = DoseResults(
        question=plan.question,
        seeds=plan.seeds,
        judged_by=", ".join(dict.fromkeys(trials.judged_by(e) for e in plan.estimators)),
        limits=plan.limits,
        curves=_curves(plan, trials, levels),
        controls=_controls(plan, trials, pairs),
    )
    return Answer(results, _kept(plan, trials, levels), trials.known)


def _next(trials: Trials, plan: Plan, levels: Mapping[_Pair, dict[float, None]]) -> list[Trial]:
    """The next trials of every curve and seed; their levels join those that were tried."""
    found = []
    for pair, tried in levels.items():
        for seed, own in zip(pair.seeds, pair.baseline_seeds, strict=True):
            was = broken(trials, pair.estimator, pair.axis, seed, own, plan.limits[0], tuple(tried))
            fresh = next_levels(pair.axis, was)
            tried |= dict.fromkeys(fresh)
            found += [trials.dosed(pair.estimator, seed, dose_of(pair.axis, v)) for v in fresh]
    return found


def _kept(
    plan: Plan, trials: Trials, levels: Mapping[_Pair, Mapping[float, None]]
) -> tuple[Run, ...]:
    """The runs of the first seed: baselines, then the levels of every curve."""
    asked = [trials.baseline(estimator, plan.seeds[0]) for estimator in plan.estimators]
    asked += [
        trials.dosed(pair.estimator, plan.seeds[0], dose_of(pair.axis, level))
        for pair, tried in levels.items()
        for level in sorted(tried, key=lambda v: abs(v - pair.axis.baseline))
    ]
    return tuple(trials.run(trial) for trial in asked if trials.numbers(trial) is not None)


def _pairs(bundle: Bundle, plan: Plan, trials: Trials) -> list[_Pair]:
    """Every estimator that has a baseline with every perturbation, and the seeds that count."""
    first, *others = plan.seeds
    drawn = {axis: draws(bundle.view(), axis) for axis in plan.axes}
    pairs = []
    for axis in plan.axes:
        for estimator in plan.estimators:
            baseline = trials.baseline(estimator, first)
            if trials.reason(baseline) or not trials.has_pose(baseline):
                continue
            second = trials.baseline(estimator, others[0]) if others else None
            same = second is not None and trials.same_bits(baseline, second)
            is_random = drawn[axis] or not same
            seeds = plan.seeds if is_random else plan.seeds[:1]
            own = tuple(first if same else seed for seed in seeds)
            pairs.append(_Pair(estimator, axis, seeds, own, is_random))
    return pairs


def _positives(trials: Trials, plan: Plan, pairs: list[_Pair]) -> list[Trial]:
    """The positive controls that are still to be tried."""
    found = []
    for estimator in dict.fromkeys(pair.estimator for pair in pairs):
        dose = next_positive(trials, plan, estimator)
        if dose is not None:
            found.append(trials.dosed(estimator, plan.seeds[0], dose))
    return found


def _curves(
    plan: Plan, trials: Trials, levels: Mapping[_Pair, Mapping[float, None]]
) -> tuple[DoseCurve, ...]:
    known = {(pair.axis, pair.estimator): pair for pair in levels}
    curves = []
    for axis in plan.axes:
        for estimator in plan.estimators:
            pair = known.get((axis, estimator))
            if pair is None:
                why = trials.reason(trials.baseline(estimator, plan.seeds[0]))
                curves.append(
                    no_curve(trials, estimator, axis, why or "it has no pose even undisturbed")
                )
                continue
            curves.append(
                curve(trials, plan, estimator, axis, tuple(levels[pair]), pair.seeds,
                      pair.baseline_seeds, is_random=pair.is_random)
            )  # fmt: skip
    return tuple(curves)


def _controls(plan: Plan, trials: Trials, pairs: list[_Pair]) -> tuple[Control, ...]:
    found = [no_op(trials, plan, pair.estimator, pair.axis) for pair in pairs]
    whose = dict.fromkeys(pair.estimator for pair in pairs)
    return (*found, *(positive(trials, plan, estimator) for estimator in whose))


def _share_of(progress: Progress | None, done: int, count: int, most: int) -> Progress | None:
    """A share of one round, told as that of all trials that may come."""
    if progress is None:
        return None
    whole = max(most, done + count)
    return lambda words, share: progress(words, (done + share * count) / whole)
