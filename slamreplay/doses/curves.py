"""One perturbation of one estimator, from its trials."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slamreplay.doses.controls import is_beyond
from slamreplay.doses.measure import Measured
from slamreplay.doses.metrics import METRICS
from slamreplay.doses.plan import Axis, Dose, Plan
from slamreplay.doses.trials import Trials
from slamreplay.replay.dose import Critical, DoseCurve, Limit, Paired, Response
from slamreplay.replay.dose_statistics import bracket_of, critical_of, holds_again, paired


def dose_of(axis: Axis, level: float) -> Dose:
    """A level of an axis."""
    return Dose(axis.perturbation, axis.unit, level)


def broken(
    trials: Trials, estimator: str, axis: Axis, seed: int, baseline_seed: int, limit: Limit,
    levels: Sequence[float],
) -> dict[float, bool | None]:  # fmt: skip
    """By level that was tried, the baseline among them, whether a limit is crossed.

    Args:
        trials: what is known.
        estimator: whose.
        axis: which perturbation.
        seed: of the trials.
        baseline_seed: of the baseline: another one where all baselines are the same.
        limit: which.
        levels: that may have been tried.
    """
    undisturbed = trials.numbers(trials.baseline(estimator, baseline_seed)) or {}
    found = {axis.baseline: is_beyond(undisturbed.get(limit.metric), limit)}
    for level in levels:
        numbers = trials.numbers(trials.dosed(estimator, seed, dose_of(axis, level)))
        if numbers is not None:
            found[level] = is_beyond(numbers.get(limit.metric), limit)
    return found


def curve(
    trials: Trials, plan: Plan, estimator: str, axis: Axis, levels: Sequence[float],
    seeds: Sequence[int], baseline_seeds: Sequence[int], *, is_random: bool,
) -> DoseCurve:  # fmt: skip
    """The curve, once all its trials are known.

    Args:
        trials: what is known.
        plan: the design.
        estimator: whose.
        axis: which perturbation.
        levels: every level that any seed tried.
        seeds: S seeds of the trials.
        baseline_seeds: S seeds of their baselines.
        is_random: whether anything in a trial is drawn.
    """
    levels = sorted(levels, key=lambda level: abs(level - axis.baseline))
    pairs = list(zip(seeds, baseline_seeds, strict=True))
    critical, notes = [], []
    for limit in plan.limits:
        each = []
        for seed, own in pairs:
            was = broken(trials, estimator, axis, seed, own, limit, levels)
            each.append({abs(level - axis.baseline): is_so for level, is_so in was.items()})
        brackets = [bracket_of(by_distance) for by_distance in each]
        critical.append(critical_of(limit.metric, brackets, axis.baseline, axis.side))
        again = sorted({d for by_distance in each for d in holds_again(by_distance)})
        if again:
            where = ", ".join(f"{axis.baseline + axis.side * d:.4g}" for d in again[:3])
            more = " and farther out" if len(again) > 3 else ""
            many = sum(bool(holds_again(by_distance)) for by_distance in each)
            notes.append(
                f"{limit.metric} keeps its limit again at {where} {axis.unit}{more} "
                f"({many} of {len(each)} seeds): the first crossing is told"
            )
    notes += [
        f"{c.metric} is beyond its limit undisturbed: no dose can be blamed for it"
        for c in critical
        if c.outcome == "always"
    ]
    refused = _refusals(trials, estimator, axis, levels, seeds)
    notes += [f"{level:.4g} {axis.unit} is not applicable: {why}" for level, why in refused.items()]
    notes += _gaps(trials, estimator, axis, [v for v in levels if v not in refused], pairs, plan)
    if not is_random and len(plan.seeds) > 1:
        notes.append("nothing in these trials is drawn at random: one run stands for all seeds, "
                     "and there is no spread")  # fmt: skip
    responses = [_baseline(trials, estimator, axis, pairs)]
    responses += [_response(trials, estimator, dose_of(axis, level), pairs) for level in levels]
    every = len(refused) == len(levels)
    return DoseCurve(
        estimator=estimator,
        perturbation=axis.perturbation,
        unit=axis.unit,
        baseline=axis.baseline,
        by_factor=axis.by_factor,
        judged_by=trials.judged_by(estimator),
        seeds=tuple(seeds),
        is_random=is_random,
        responses=() if every else tuple(responses),
        critical=() if every else tuple(critical),
        broke_first=None if every else _first(critical, axis.baseline),
        notes=() if every else tuple(notes),
        reason=next(iter(refused.values())) if every else "",
    )


def no_curve(trials: Trials, estimator: str, axis: Axis, reason: str) -> DoseCurve:
    """The curve of an estimator that says nothing undisturbed."""
    return DoseCurve(
        estimator=estimator,
        perturbation=axis.perturbation,
        unit=axis.unit,
        baseline=axis.baseline,
        by_factor=axis.by_factor,
        judged_by=trials.judged_by(estimator),
        seeds=(),
        is_random=False,
        responses=(),
        critical=(),
        broke_first=None,
        reason=reason,
    )


def _first(critical: Sequence[Critical], baseline: float) -> str | None:
    """The metric that crosses at the least level; of several there the first.

    One that is beyond its limit undisturbed was broken by no dose.
    """
    reached = [
        (abs(c.level - baseline), c.metric)
        for c in critical
        if c.outcome == "crossed" and c.level is not None
    ]
    return min(reached, key=lambda pair: pair[0])[1] if reached else None


def _refusals(
    trials: Trials, estimator: str, axis: Axis, levels: Sequence[float], seeds: Sequence[int]
) -> dict[float, str]:
    """Levels at which no trial was applicable, with the reason of the first seed."""
    found = {}
    for level in levels:
        asked = [trials.dosed(estimator, seed, dose_of(axis, level)) for seed in seeds]
        reasons = [trials.reason(trial) for trial in asked if trials.numbers(trial) is not None]
        if reasons and all(reasons):
            found[level] = reasons[0]
    return found


def _gaps(
    trials: Trials, estimator: str, axis: Axis, levels: Sequence[float],
    pairs: Sequence[tuple[int, int]], plan: Plan,
) -> list[str]:  # fmt: skip
    """Levels at which some seeds have no number, though undisturbed they have: no break is seen."""
    notes = []
    for limit in plan.limits:
        missing: dict[float, list[int]] = {}
        for seed, own in pairs:
            was = broken(trials, estimator, axis, seed, own, limit, levels)
            for level in levels:
                if was[axis.baseline] is not None and was.get(level, False) is None:
                    missing.setdefault(level, []).append(seed)
        if missing:
            level, seeds = max(missing.items(), key=lambda item: len(item[1]))
            trial = trials.dosed(estimator, seeds[0], dose_of(axis, level))
            why = trials.reason(trial) or "too few poses"
            notes.append(
                f"{limit.metric} has no number at {level:.4g} {axis.unit} with {len(seeds)} of "
                f"{len(pairs)} seeds ({why}): it counts neither as held nor as broken"
            )
    return notes


def _baseline(
    trials: Trials, estimator: str, axis: Axis, pairs: Sequence[tuple[int, int]]
) -> Response:
    numbers = [trials.numbers(trials.baseline(estimator, own)) or {} for _, own in pairs]
    return Response(axis.baseline, _values(numbers), {})


def _response(
    trials: Trials, estimator: str, dose: Dose, pairs: Sequence[tuple[int, int]]
) -> Response:
    with_it = [trials.numbers(trials.dosed(estimator, seed, dose)) or {} for seed, _ in pairs]
    without = [trials.numbers(trials.baseline(estimator, own)) or {} for _, own in pairs]
    differences: dict[str, Paired] = {}
    for metric in METRICS:
        both = [
            (a, b)
            for a, b in ((one.get(metric), other.get(metric))
                         for one, other in zip(with_it, without, strict=True))
            if a is not None and b is not None and math.isfinite(a) and math.isfinite(b)
        ]  # fmt: skip
        found = paired(both)
        if found is not None:
            differences[metric] = Paired(_six(found.mean), _end(found.low), _end(found.high),
                                         found.n)  # fmt: skip
    return Response(dose.level, _values(with_it), differences)


def _values(numbers: Sequence[Measured]) -> dict[str, tuple[float | None, ...]]:
    """By metric, the numbers of every seed; metrics that none has are left out."""
    found = {}
    for metric in METRICS:
        row = tuple(_end(one.get(metric)) for one in numbers)
        if any(value is not None for value in row):
            found[metric] = row
    return found


def _six(value: float) -> float:
    """Six digits: more are noise, and three times the file."""
    return float(f"{value:.6g}")


def _end(value: float | None) -> float | None:
    """The same of what may be missing; what is endless stands as missing in a file."""
    return None if value is None or not math.isfinite(value) else _six(value)
