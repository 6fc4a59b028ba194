"""The numbers of a run that a limit may be put on."""

from __future__ import annotations

from slamreplay.errors import UsageError
from slamreplay.registry import nearest
from slamreplay.replay.dose import Limit

#: Name to what it is, in the words of "... above LIMIT", and the unit.
METRICS: dict[str, tuple[str, str]] = {
    "error_max_m": ("greatest error", "m"),
    "error_rmse_m": ("rms error", "m"),
    "error_median_m": ("median error", "m"),
    "error_final_m": ("error at the end", "m"),
    "error_max_deg": ("greatest error of heading", "deg"),
    "error_final_deg": ("error of heading at the end", "deg"),
    "lost_s": ("lost for longer in all", "s"),
    "lost_share": ("share of moments off", ""),
    "unposed_share": ("share of moments without a pose", ""),
    "sigma_m": ("median sigma", "m"),
    "sigma_max_m": ("greatest sigma", "m"),
    "nees_mean": ("mean NEES", ""),
    "nees_interval_ratio": ("mean NEES over the end of its 95 % interval", ""),
    "baseline_median_m": ("median distance from the baseline", "m"),
    "baseline_max_m": ("greatest distance from the baseline", "m"),
    "baseline_final_m": ("distance from the baseline at the end", "m"),
    "ate_aligned_m": ("aligned trajectory error", "m"),
    "relations_m": ("mean error of relations", "m"),
    "relations_rad": ("mean error of relations", "rad"),
}


def limit_of(metric: str, at_most: float) -> Limit:
    """A limit with its title.

    Raises:
        UsageError: no run has such a number; the hint holds the nearest one.
    """
    if metric not in METRICS:
        raise UsageError(f"there is no metric {metric[:80]!r}", hint=nearest(metric, METRICS))
    words, unit = METRICS[metric]
    value = f"{at_most:g} {unit}".rstrip()
    if metric == "lost_s":
        return Limit(metric, at_most, f"lost for more than {value}")
    return Limit(metric, at_most, f"{words} above {value}")
