"""Trials whose answer is known beforehand, so that the design itself is tested."""

from __future__ import annotations

from collections.abc import Sequence

from slamreplay.doses.measure import Measured
from slamreplay.doses.plan import Axis, Dose, Plan
from slamreplay.doses.trials import Trials
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.dose import Control, Limit

#: Tried in turn where the design names none, until one breaks the estimator.
USUAL = (
    Dose("initial_pose.offset", "m", 20.0),
    Dose("odometry_scale.rotation", "ratio", 0.0),
    Dose("scan_drop.even", "ratio", 0.99),
)

_ANOTHER = (
    "another run than without it: the code path itself changes the answer, so that a response to "
    "this perturbation is not its dose's alone"
)
_BLIND = (
    "crosses no limit although it should break the run: with these limits the design may not see a "
    "break, and 'never' means little"
)


def no_op_of(axis: Axis) -> Dose:
    """A perturbation at the level that changes nothing."""
    return Dose(axis.perturbation, axis.unit, axis.baseline)


def positive_doses(plan: Plan) -> tuple[Dose, ...]:
    """What is known to break an estimator."""
    if plan.positive_control is not None:
        return (plan.positive_control,)
    return tuple(d for d in USUAL if d.perturbation.partition(".")[0] in PERTURBATIONS)


def next_positive(trials: Trials, plan: Plan, estimator: str) -> Dose | None:
    """The positive control that is still to be tried, None where the answer is known."""
    for dose in positive_doses(plan):
        if trials.numbers(trials.dosed(estimator, plan.seeds[0], dose)) is None:
            return dose
        if _newly_crossed(trials, plan, estimator, dose):
            return None
    return None


def no_op(trials: Trials, plan: Plan, estimator: str, axis: Axis) -> Control:
    """What became of a perturbation at its baseline level, which is to give the baseline's bits."""
    seed, dose = plan.seeds[0], no_op_of(axis)
    trial, baseline = trials.dosed(estimator, seed, dose), trials.baseline(estimator, seed)
    reason = trials.reason(trial)
    passed = None if reason else trials.same_bits(trial, baseline)
    text = {None: f"not applicable: {reason}", True: "the same bits as without it", False: _ANOTHER}
    return Control(
        "no_op", estimator, dose.perturbation, dose.level, dose.unit, passed, text[passed]
    )


def positive(trials: Trials, plan: Plan, estimator: str) -> Control:
    """What became of the trials that are known to break a run; one of them is to."""
    broken_already = _broken_already(trials, plan, estimator)
    doses = positive_doses(plan)
    reasons = {d: trials.reason(trials.dosed(estimator, plan.seeds[0], d)) for d in doses}
    tried = [dose for dose in doses if not reasons[dose]]
    for dose in tried:
        fresh = _newly_crossed(trials, plan, estimator, dose)
        if fresh:
            return _told(estimator, dose, f"crosses {fresh[0].metric}", passed=True)
    if not tried:
        return _told(estimator, doses[0], f"not applicable: {reasons[doses[0]]}", passed=None)
    if broken_already:
        already = f"shows nothing: {broken_already[0].metric} is beyond its limit undisturbed"
        return _told(estimator, tried[-1], already, passed=False)
    baseline = trials.numbers(trials.baseline(estimator, plan.seeds[0])) or {}
    last = trials.numbers(trials.dosed(estimator, plan.seeds[0], tried[-1])) or {}
    lost = [x.metric for x in plan.limits
            if last.get(x.metric) is None and baseline.get(x.metric) is not None]  # fmt: skip
    if lost:
        gone = f"shows nothing: it leaves too few poses for {lost[0]}; name a positive_control"
        return _told(estimator, tried[-1], gone, passed=False)
    return _told(estimator, tried[-1], _BLIND, passed=False)


def _broken_already(trials: Trials, plan: Plan, estimator: str) -> list[Limit]:
    """Limits that the undisturbed run of the first seed is beyond."""
    baseline = trials.numbers(trials.baseline(estimator, plan.seeds[0])) or {}
    return crossed(baseline, plan.limits)


def _newly_crossed(trials: Trials, plan: Plan, estimator: str, dose: Dose) -> list[Limit]:
    """Limits that a dose broke: what was broken without it shows nothing."""
    numbers = trials.numbers(trials.dosed(estimator, plan.seeds[0], dose)) or {}
    already = _broken_already(trials, plan, estimator)
    return [limit for limit in crossed(numbers, plan.limits) if limit not in already]


def _told(estimator: str, dose: Dose, text: str, *, passed: bool | None) -> Control:
    return Control("positive", estimator, dose.perturbation, dose.level, dose.unit, passed, text)


def crossed(numbers: Measured, limits: Sequence[Limit]) -> list[Limit]:
    """Limits that a run is beyond."""
    return [limit for limit in limits if is_beyond(numbers.get(limit.metric), limit)]


def is_beyond(value: float | None, limit: Limit) -> bool | None:
    """Whether a number is beyond its limit; None where there is no number."""
    return None if value is None else value > limit.at_most
