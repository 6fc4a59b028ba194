"""From a post-mortem to its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import Lane
from slamreplay.evidence.scene_lanes import scene_lanes
from slamreplay.gate.judged import judged_moments, why_unjudged
from slamreplay.gate.measured_covariance import covariance_numbers
from slamreplay.gate.measured_deeds import deed_numbers
from slamreplay.gate.measured_trials import trial_numbers
from slamreplay.gate.measures import Answer, Measure, Measures, Series, mean_of, p95_of
from slamreplay.gate.metrics import METRICS
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.judgement import UNDECIDED, Interval

#: Lanes that mean nothing at moments that the verdict could not judge.
_JUDGED_LANES = ("error_m", "error_deg", "changed_share")


def measures_of(post: Postmortem) -> Measures:
    """Every number of `METRICS`, and those of the undisturbed trials.

    Errors and changed beams are taken over the moments that the verdict judged: hindsight that
    cannot be trusted accuses nobody.
    """
    lanes = {lane.key: _told(lane, post) for lane in _lanes(post)}
    series = {str(key): lane for key, lane in lanes.items() if np.isfinite(lane.values).any()}
    told: dict[str, Answer] = {}
    for numbers in (
        _error_numbers(series, post),
        _time_numbers(post),
        _change_numbers(series, post),
        covariance_numbers(post, series.get("sigma_m")),
        deed_numbers(post),
        _hindsight_numbers(series, post),
        trial_numbers(post),
    ):
        told |= dict(numbers)
    missing = {name: why for name, why in told.items() if isinstance(why, str)}
    for name, metric in METRICS.items():
        if metric.over_time and name not in series:
            missing[name] = missing[_LIKE[name]]
    values = {name: one for name, one in told.items() if isinstance(one, Measure)}
    return Measures(post.manifest.start_ns, post.manifest.end_ns, values, series, missing)


#: A number that is missing for the same reason as one over time.
_LIKE = {
    "error_m": "error_max_m",
    "error_deg": "error_max_deg",
    "sigma_m": "sigma_max_m",
    "nees": "nees_mean",
    "changed_share": "changed_share_mean",
    "match": "match_median",
}


def _lanes(post: Postmortem) -> tuple[Lane, ...]:
    return scene_lanes(post) if post.scene is None else post.scene.lanes


def _told(lane: Lane, post: Postmortem) -> Series:
    values = lane.values
    if lane.key in _JUDGED_LANES:
        values = np.where(judged_moments(post, lane.t_ns), values, np.nan)
    return Series(lane.t_ns, values, lane.unit)


def _error_numbers(series: dict[str, Series], post: Postmortem) -> Iterator[tuple[str, Answer]]:
    names = {
        "error_m": ("error_max_m", "error_p95_m", "error_mean_m", "error_rmse_m"),
        "error_deg": ("error_max_deg", "error_mean_deg"),
    }
    for key, of_key in names.items():
        found = series.get(key)
        if found is None:
            why = why_unjudged(post, "the belief was nowhere held against hindsight")
            yield from ((name, why) for name in of_key)
            continue
        known = found.values[np.isfinite(found.values)]
        unit = found.unit
        yield of_key[0], Measure(float(known.max()), unit)
        yield f"error_mean_{unit}", mean_of(known, unit)
        if key == "error_m":
            yield "error_p95_m", p95_of(known, unit)
            square = mean_of(known**2, unit)  # its root is as sure as the mean of the squares
            root = [None if v is None else float(np.sqrt(max(v, 0.0)))
                    for v in (square.low, square.high)]  # fmt: skip
            rmse = float(np.sqrt(square.value))
            yield "error_rmse_m", Measure(rmse, unit, root[0], root[1], square.n_eff)


def _time_numbers(post: Postmortem) -> Iterator[tuple[str, Answer]]:
    intervals = post.judgement.intervals
    whole_s = (post.manifest.end_ns - post.manifest.start_ns) / NS_PER_S
    yield "duration_s", Measure(whole_s, "s")
    unjudged_s = _seconds(i for i in intervals if i.state in UNDECIDED)
    yield "unjudged_s", Measure(unjudged_s, "s")
    judged_s = _seconds(intervals) - unjudged_s
    share: Answer = "the log has no length"
    yield "unjudged_share", Measure(unjudged_s / whole_s, "") if whole_s > 0.0 else share
    lost_s = _seconds(i for i in intervals if i.is_lost)
    changed_s = _seconds(i for i in intervals if i.is_changed)
    for name, seconds in (("lost", lost_s), ("changed", changed_s)):
        if judged_s > 0.0:
            yield f"{name}_s", Measure(seconds, "s")
            yield f"{name}_time_share", Measure(seconds / judged_s, "")
        else:
            why = why_unjudged(post, "no moment could be judged")
            yield from ((f"{name}_s", why), (f"{name}_time_share", why))
    sure = post.judgement.confidence
    yield "confidence", post.judgement.summary if sure is None else Measure(sure, "")
    for name in ("error", "warning"):
        count = sum(finding.severity == name for finding in post.findings)
        yield f"{name}s", Measure(float(count), "")


def _change_numbers(series: dict[str, Series], post: Postmortem) -> Iterator[tuple[str, Answer]]:
    found = series.get("changed_share")
    changes = None if post.hindsight is None else post.hindsight.changes
    if found is None or changes is None:
        why = why_unjudged(post, "no beam was compared with the map")
        yield from (("changed_share_mean", why), ("changed_area_m2", why))
        return
    yield "changed_share_mean", mean_of(found.values, "", most=1.0)
    area = sum(region.area_m2 for region in changes.regions)
    yield "changed_area_m2", Measure(float(area), "m2")


def _hindsight_numbers(series: dict[str, Series], post: Postmortem) -> Iterator[tuple[str, Answer]]:
    names = ("hindsight_coverage", "hindsight_sigma_m", "hindsight_margin", "match_median")
    hindsight = post.hindsight
    if hindsight is None:
        why = why_unjudged(post, "hindsight could not be rebuilt")
        yield from ((name, why) for name in names)
        return
    yield "hindsight_coverage", Measure(hindsight.coverage, "")
    sigma = hindsight.sigma_m
    yield (
        "hindsight_sigma_m",
        (Measure(float(sigma), "m") if np.isfinite(sigma) else "hindsight has no covariance"),
    )
    none = "no different sequence of places was found to compare with"
    margin = hindsight.margin
    yield "hindsight_margin", none if margin is None else Measure(float(margin), "")
    match = series.get("match")
    yield (
        "match_median",
        (
            "no scan was compared with the map"
            if match is None
            else Measure(float(np.nanmedian(match.values)), "")
        ),
    )


def _seconds(intervals: Iterable[Interval]) -> float:
    return sum(i.duration_ns for i in intervals) / NS_PER_S
