"""Which numbers are held against a baseline, which way is worse, and from where on it matters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from slamreplay.gate.metrics import METRICS, OF_TRIALS, Better, Metric
from slamreplay.gate.rules import BaselineRules

#: The mean of a number over time, by the number.
MEAN_OF: dict[str, str] = {
    "error_m": "error_mean_m",
    "error_deg": "error_mean_deg",
    "sigma_m": "sigma_mean_m",
    "nees": "nees_mean",
    "changed_share": "changed_share_mean",
    "match": "match_mean",
}
_SERIES_OF = {mean: series for series, mean in MEAN_OF.items()}
#: Numbers per log that are held against each other over all logs: one log has but one of each.
PER_LOG: tuple[str, ...] = (
    "error_max_m",
    "error_p95_m",
    "error_max_deg",
    "lost_s",
    "unjudged_s",
    "sigma_max_m",
    "jumps",
    "stops",
    "recoveries",
    "needless_recoveries",
    "risky_actions",
    "pose_age_p95_s",
    "correction_age_p95_s",
    "hindsight_coverage",
    "hindsight_sigma_m",
)


@dataclass(frozen=True)
class Margin:
    """What a mean must change by to matter: the greater of the two.

    Attributes:
        absolute: in the unit of the number.
        share: of the baseline's value.
    """

    absolute: float
    share: float = 0.0


#: A centimetre or two, half a degree, a tenth of a match do not change what a robot does.
MARGINS: dict[str, Margin] = {
    "error_mean_m": Margin(0.02),
    "error_mean_deg": Margin(0.5),
    "sigma_mean_m": Margin(0.02),
    "nees_mean": Margin(0.5, 0.2),
    "changed_share_mean": Margin(0.01),
    "match_mean": Margin(0.02),
    "hindsight_coverage": Margin(0.01),
    "hindsight_sigma_m": Margin(0.01),
    "lost_share": Margin(0.01),
    "nees_interval_ratio": Margin(0.1, 0.2),
    **dict.fromkeys(
        ("jumps", "stops", "recoveries", "needless_recoveries", "risky_actions"), Margin(0.2)
    ),
}
#: Of all others, by unit.
_BY_UNIT = {"m": Margin(0.05), "deg": Margin(1.0), "s": Margin(0.1, 0.05)}


def metric_named(name: str) -> Metric | None:
    """What a number of a baseline is, its unit above all; None where this program has none."""
    _, dot, of_trial = name.partition(".")
    if dot:
        return OF_TRIALS.get(of_trial)
    # Not every mean of a number over time can be limited: such a one is what the number is.
    return METRICS.get(name) or METRICS.get(_SERIES_OF.get(name, ""))


def compared(estimators: tuple[str, ...] = ()) -> tuple[str, ...]:
    """All numbers that are compared, and may be given a margin of their own."""
    of_trials = [name for name, metric in OF_TRIALS.items() if metric.better != "either"]
    trials = [f"{estimator}.{name}" for estimator in estimators for name in of_trials]
    return (*MEAN_OF.values(), *PER_LOG, *trials)


def margin_of(name: str, old: float, rules: BaselineRules) -> float:
    """From which difference on a number matters: as the recipe says, or by default."""
    if name in rules.margins:
        return rules.margins[name]
    metric = metric_named(name)
    unit = "" if metric is None else metric.unit
    margin = MARGINS.get(name.rpartition(".")[2], _BY_UNIT.get(unit, Margin(0.02, 0.1)))
    return max(margin.absolute, margin.share * abs(old))


def is_worse(name: str, old: float, new: float, expected: float | None = None) -> bool:
    """Whether the new value is the worse one.

    Args:
        name: of the number.
        old: in the baseline.
        new: now.
        expected: of a number that has a right value, that value: the degrees of freedom of a mean
            NEES. Farther from it by factor is worse; where it is not known, more is.
    """
    metric = metric_named(name)
    better: Better = "less" if metric is None else metric.better
    if better == "more":
        return new < old
    if better == "either" and expected is not None and min(old, new) > 0.0:
        return abs(math.log(new / expected)) > abs(math.log(old / expected))
    return new > old


def has_side(name: str) -> bool:
    """Whether one side of a number is known to be the better."""
    metric = metric_named(name)
    return metric is not None and metric.better != "either"


def expected_nees(values: Mapping[str, float]) -> float | None:
    """Degrees of freedom of a log's mean NEES: it is that of the pose, or of the position alone."""
    mean, factor = values.get("nees_mean"), values.get("nees_factor")
    if mean is None or not factor or not math.isfinite(mean) or not math.isfinite(factor):
        return None
    return float(max(1, round(mean / factor**2)))
