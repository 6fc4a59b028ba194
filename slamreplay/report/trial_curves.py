"""Trials that nobody laid out as a design, read as one: a curve for each perturbation tried."""

from __future__ import annotations

from collections.abc import Sequence

from slamreplay.evidence.result import Postmortem, TrialResult
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.dose import DoseCurve, DoseResults, Limit, Response
from slamreplay.replay.dose_statistics import Bracket, bracket_of, critical_of, paired

#: The number that breaks, by how good its judge is, and what it is held against.
_METRICS = (
    ("reference_max_m", "reference"),
    ("hindsight_max_m", "hindsight"),
    ("baseline_max_m", "baseline"),
)


def curves_of_trials(post: Postmortem) -> DoseResults | None:
    """The trials of a post-mortem as curves of the greatest error; None where nothing was changed.

    There are no controls and one seed a curve: what a recipe adds is not feigned.
    """
    trials = [t for t in post.trials if _is_known(t)]
    known = {name for t in trials for name, value in t.metrics.items() if value is not None}
    metric, judge = next((pair for pair in _METRICS if pair[0] in known), ("", ""))
    if not metric:
        return None
    at_most = post.limits.position_m
    limit = Limit(metric, at_most, f"greatest error above {at_most:g} m")
    groups: dict[tuple[str, str, str, int, bool], list[TrialResult]] = {}
    for one in trials:
        trial = one.run.trial
        is_below = (trial.level or 0.0) < _baseline_level(one)
        key = (trial.perturbation or "", trial.estimator, trial.parameters, trial.seed, is_below)
        groups.setdefault(key, []).append(one)
    order = list(dict.fromkeys((key[0], key[-1]) for key in groups))
    curves = [
        _curve(groups[key], _undisturbed(post, groups[key][0]), limit, judge)
        for key in sorted(groups, key=lambda key: order.index((key[0], key[-1])))
    ]
    seeds = tuple(sorted({t.run.trial.seed for t in trials}))
    question = "What do the levels that were tried do to the greatest error?"
    return DoseResults(question, seeds, judge, (limit,), tuple(curves), ())


def _curve(
    trials: Sequence[TrialResult], undisturbed: TrialResult | None, limit: Limit, judge: str
) -> DoseCurve:
    first = trials[0].run.trial
    baseline, metric = _baseline_level(trials[0]), limit.metric
    side = -1 if (first.level or 0.0) < baseline else 1
    without = None if undisturbed is None else undisturbed.metrics.get(metric)
    done = sorted(
        (t for t in trials if t.run.estimate is not None),
        key=lambda t: abs((t.run.trial.level or 0.0) - baseline),
    )
    responses = [Response(baseline, {metric: (without,)}, {})]
    broken = {0.0: None if without is None else without > limit.at_most}
    for one in done:
        level, value = one.run.trial.level or 0.0, one.metrics.get(metric)
        both = [] if value is None or without is None else [(value, without)]
        found = paired(both)
        responses.append(
            Response(level, {metric: (value,)}, {} if found is None else {metric: found})
        )
        broken[abs(level - baseline)] = None if value is None else value > limit.at_most
    bracket: Bracket | None = bracket_of(broken)
    critical = critical_of(metric, [bracket], baseline, side)
    return DoseCurve(
        estimator=first.estimator,
        perturbation=first.perturbation or "",
        unit=first.unit,
        baseline=baseline,
        by_factor=False,
        judged_by=judge,
        seeds=(first.seed,),
        is_random=False,
        responses=tuple(responses) if done else (),
        critical=(critical,) if done else (),
        # No dose is to be blamed for what is broken undisturbed.
        broke_first=metric if critical.outcome == "crossed" else None,
        reason="" if done else trials[0].run.not_applicable or "no estimate",
    )


def _is_known(one: TrialResult) -> bool:
    """Whether it was perturbed, by something that is installed here."""
    name, _, variant = (one.run.trial.perturbation or "").partition(".")
    return name in PERTURBATIONS and variant in PERTURBATIONS.load(name).variants


def _baseline_level(one: TrialResult) -> float:
    name, _, variant = (one.run.trial.perturbation or "").partition(".")
    return float(PERTURBATIONS.load(name).variants[variant].baseline)


def _undisturbed(post: Postmortem, one: TrialResult) -> TrialResult | None:
    trial = one.run.trial
    return next(
        (
            t
            for t in post.trials
            if t.run.trial.perturbation is None
            and (t.run.trial.estimator, t.run.trial.parameters, t.run.trial.seed)
            == (trial.estimator, trial.parameters, trial.seed)
        ),
        None,
    )
