"""Numbers of estimators that ran again on the log, undisturbed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from slamreplay.consistency.statistics.mean_test import N_EFF_MIN
from slamreplay.evidence.result import Postmortem, TrialResult
from slamreplay.gate.measures import Answer, Measure
from slamreplay.gate.metrics import OF_TRIALS

_DEG = math.degrees(1.0)
#: Name to the number of a trial that it is, and the factor to its unit.
_FROM = {
    "error_max_m": ("hindsight_max_m", 1.0),
    "error_rmse_m": ("hindsight_rmse_m", 1.0),
    "error_max_deg": ("hindsight_max_rad", _DEG),
    "reference_max_m": ("reference_max_m", 1.0),
    "reference_rmse_m": ("reference_rmse_m", 1.0),
    "reference_max_deg": ("reference_max_rad", _DEG),
    "lost_share": ("lost_share", 1.0),
    "nees_mean": ("nees_mean", 1.0),
    "ate_aligned_m": ("ate_aligned_m", 1.0),
    "relations_m": ("relations_m", 1.0),
    "relations_deg": ("relations_rad", _DEG),
}
#: Infinite of a run that has not one pose: no belief is the worst.
_OF_THE_PATH = ("error_max_m", "error_rmse_m", "error_max_deg")


def trial_numbers(post: Postmortem) -> Iterator[tuple[str, Answer]]:
    """`ESTIMATOR.NAME` for every estimator that was run, of several seeds the worst."""
    undisturbed = [t for t in post.trials if not t.run.trial.perturbation]
    for estimator in dict.fromkeys(t.run.trial.estimator for t in undisturbed):
        seeds = [t for t in undisturbed if t.run.trial.estimator == estimator]
        for name in OF_TRIALS:
            yield f"{estimator}.{name}", _worst(name, seeds, post)


def _worst(name: str, seeds: Sequence[TrialResult], post: Postmortem) -> Answer:
    refused = next((s.run.not_applicable for s in seeds if s.run.estimate is None), None)
    if refused is not None:
        return refused
    told = [number for one in seeds if (number := _number(name, one, post)) is not None]
    if not told:
        return _lack(name, post)
    return Measure(max(told), OF_TRIALS[name].unit, of_seeds=tuple(told))


def _number(name: str, of: TrialResult, post: Postmortem) -> float | None:
    metrics = of.metrics
    if name in _OF_THE_PATH and not metrics.get("rows_with_pose", 1.0):
        return None if post.hindsight is None else math.inf
    if name.startswith("nees"):
        if (metrics.get("nees_n_eff") or 0.0) < N_EFF_MIN:
            return None
        if name == "nees_interval_ratio":
            mean, high = metrics.get("nees_mean"), metrics.get("nees_high")
            return None if mean is None or not high else mean / high
    source, scale = _FROM[name]
    number = metrics.get(source)
    return None if number is None else scale * number


def _lack(name: str, post: Postmortem) -> str:
    if name.startswith("nees"):
        return f"no reference, no covariance or fewer than {N_EFF_MIN} independent updates"
    if name.startswith(("error", "lost")):
        return "no hindsight to hold the run against" if post.hindsight is None else "no pose"
    return "no reference that only judges is in the log"
