"""The numbers that a gate can put a limit on: names, units, and what they mean.

A name ends in its unit. Numbers per log and numbers over time are told apart by `over_time`: a
limit on one of the latter may say for how long it must be passed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from slamreplay.errors import UsageError
from slamreplay.registry import nearest

#: Which way of a change is the better one; `either`: there is a right value, on both sides of it
#: things are wrong, or the number is only told.
Better = Literal["less", "more", "either"]


@dataclass(frozen=True)
class Metric:
    """One number.

    Attributes:
        unit: of it; empty where it has none.
        doc: what it is, in a line.
        better: see `Better`.
        over_time: whether it is one number for each moment rather than one for the log.
    """

    unit: str
    doc: str
    better: Better = "less"
    over_time: bool = False


METRICS: dict[str, Metric] = {
    "error_max_m": Metric("m", "greatest distance of the belief from hindsight"),
    "error_p95_m": Metric("m", "95 of 100 moments are nearer than this to hindsight"),
    "error_mean_m": Metric("m", "mean distance of the belief from hindsight"),
    "error_rmse_m": Metric("m", "root mean square of it"),
    "error_max_deg": Metric("deg", "greatest error of heading against hindsight"),
    "error_mean_deg": Metric("deg", "mean error of heading"),
    "lost_s": Metric("s", "time the robot was lost, as of the verdict"),
    "lost_time_share": Metric("", "of the judged time, the robot was lost"),
    "changed_s": Metric("s", "time the map was contradicted, as of the verdict"),
    "changed_time_share": Metric("", "of the judged time, the map was contradicted"),
    "changed_share_mean": Metric("", "mean share of beams that contradict the map"),
    "changed_area_m2": Metric("m2", "of the map's changed regions"),
    "unjudged_s": Metric("s", "time that could not be judged"),
    "unjudged_share": Metric("", "of the log, not judged"),
    "nees_mean": Metric("", "mean NEES of the pose, or of the position alone", "either"),
    "nees_factor": Metric("", "sigma is too small by this: sqrt(mean NEES / dof)", "either"),
    "nees_factor_position": Metric("", "the same of the position alone", "either"),
    "nees_factor_heading": Metric("", "the same of the heading alone", "either"),
    "nees_interval_ratio": Metric("", "mean NEES over the upper end of its 95 % interval"),
    "sigma_max_m": Metric("m", "greatest sigma of position in its worst direction"),
    "sigma_median_m": Metric("m", "median of it"),
    "pose_age_p95_s": Metric("s", "95 of 100 poses were younger when used; the worst consumer's"),
    "correction_age_p95_s": Metric("s", "the same of the localizer's last word"),
    "stops": Metric("", "unplanned stops"),
    "recoveries": Metric("", "recoveries, recorded ones and those seen by motion"),
    "needless_recoveries": Metric("", "recoveries of a robot that was right"),
    "risky_actions": Metric("", "actions that the uncertainty of the moment did not allow"),
    "jumps": Metric("", "steps of the belief that odometry does not tell"),
    "jump_max_m": Metric("m", "greatest of them"),
    "errors": Metric("", "findings of severity error"),
    "warnings": Metric("", "findings of severity warning"),
    "hindsight_coverage": Metric("", "share of scans that hindsight has a pose for", "more"),
    "hindsight_sigma_m": Metric("m", "hindsight's own median sigma of position"),
    "hindsight_margin": Metric("", "lead of its places over the best different ones", "more"),
    "match_median": Metric("", "median scan match of unchanged beams, 0 to 1", "more"),
    "confidence": Metric("", "of the verdict", "more"),
    "duration_s": Metric("s", "of the log", "either"),
    "error_m": Metric("m", "distance of the belief from hindsight", "less", over_time=True),
    "error_deg": Metric("deg", "error of heading", "less", over_time=True),
    "sigma_m": Metric("m", "sigma of position in its worst direction", "less", over_time=True),
    "nees": Metric("", "NEES of the pose, or of the position alone", "either", over_time=True),
    "changed_share": Metric("", "share of beams that contradict the map", "less", over_time=True),
    "match": Metric("", "scan match of unchanged beams, 0 to 1", "more", over_time=True),
}

#: Numbers of an estimator that ran again, as `ESTIMATOR.NAME`; of several seeds the worst.
OF_TRIALS: dict[str, Metric] = {
    "error_max_m": Metric("m", "greatest distance of the run from hindsight"),
    "error_rmse_m": Metric("m", "root mean square of it"),
    "error_max_deg": Metric("deg", "greatest error of heading against hindsight"),
    "lost_share": Metric("", "share of moments beyond the limits of lost"),
    "nees_mean": Metric("", "mean NEES against the best reference", "either"),
    "nees_interval_ratio": Metric("", "it over the upper end of its 95 % interval"),
    "reference_max_m": Metric("m", "greatest distance from a reference that only judges"),
    "reference_rmse_m": Metric("m", "root mean square of it"),
    "reference_max_deg": Metric("deg", "greatest error of heading against that reference"),
    "ate_aligned_m": Metric("m", "absolute trajectory error, the path laid onto the reference"),
    "relations_m": Metric("m", "mean error of surveyed relations"),
    "relations_deg": Metric("deg", "the same of their turns"),
}


def metric_of(name: str, estimators: tuple[str, ...] = ()) -> Metric:
    """What a name means.

    Args:
        name: of `METRICS`, or `ESTIMATOR.NAME` of `OF_TRIALS`.
        estimators: those that the gate runs again.

    Raises:
        UsageError: there is no such number; the hint has the nearest one, or all.
    """
    estimator, dot, rest = name.partition(".")
    if not dot:
        if name not in METRICS:
            raise UsageError(f"there is no metric {name[:80]!r}", hint=nearest(name, METRICS))
        return METRICS[name]
    if estimator not in estimators:
        there = ", ".join(estimators) or "none"
        raise UsageError(
            f"{name[:80]!r} is a number of an estimator that the gate does not run",
            hint=f"'estimators' names {there}",
        )
    if rest not in OF_TRIALS:
        raise UsageError(f"estimators have no number {rest[:80]!r}", hint=nearest(rest, OF_TRIALS))
    return OF_TRIALS[rest]
