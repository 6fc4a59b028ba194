"""The three numbers that decide, for the first screen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.evidence.result import Postmortem
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report.figures.covariance import sigma_position_m
from slamreplay.report.moments import moment_link
from slamreplay.verdict.words import square_metres


@dataclass(frozen=True)
class Fact:
    """One number, what it is, what to hold it against, and where the replay shows it.

    Where there is no number a word stands in its place.
    """

    number: str
    label: str
    detail: str
    alarming: bool = False
    link: str = ""

    @property
    def is_known(self) -> bool:
        """Whether there is a number."""
        return any(character.isdigit() for character in self.number)


def deciding_facts(post: Postmortem) -> tuple[Fact, Fact, Fact]:
    """How far off the belief was, how far off the map was, and how well both are known."""
    return _belief(post), _map(post), _hindsight(post)


def _belief(post: Postmortem) -> Fact:
    label = "widest gap between belief and where it really was"
    if post.belief is None or not post.belief.has_pose.any():
        return Fact("no belief", label, "No localizer spoke in this log: lost cannot be judged.")
    error = post.error
    if error is None or not np.isfinite(error.distance_m).any():
        return Fact("unknown", label, "Where the robot really was cannot be rebuilt from this log.")
    worst = int(np.nanargmax(error.distance_m))
    lost_s = sum(i.duration_ns for i in post.judgement.intervals if i.is_lost) / NS_PER_S
    limits = post.limits
    detail = (
        f"At {float(post.seconds(error.t_ns[worst])):.1f} s; heading off by up to "
        f"{np.degrees(np.nanmax(error.heading_rad)):.0f} deg. Lost for {lost_s:.1f} s in all "
        f"(over {limits.position_m:g} m or {np.degrees(limits.yaw_rad):.0f} deg "
        f"for {limits.lost_s:g} s)."
    )
    if post.frame_offset is not None:
        detail = f"The constant shift of the map frame is taken out. {detail}"
    sigma = sigma_position_m(post.belief)[worst]
    if np.isfinite(sigma):
        detail += f" The filter claimed ±{_length(float(sigma))} (1 sigma) at that moment."
    number, link = (
        _length(float(error.distance_m[worst])),
        moment_link(post, int(error.t_ns[worst])),
    )
    return Fact(number, label, detail, alarming=lost_s > 0.0, link=link)


def _map(post: Postmortem) -> Fact:
    label = "of the beams contradicted the map, in its worst stretch"
    if post.grid is None:
        return Fact("no map", label, "Without a map nothing can be said about a changed aisle.")
    changes = None if post.hindsight is None else post.hindsight.changes
    if changes is None or not np.isfinite(changes.changed_share).any():
        return Fact("unknown", label, "Beams cannot be replayed without hindsight poses.")
    limits = post.limits
    changed_s = sum(i.duration_ns for i in post.judgement.intervals if i.is_changed) / NS_PER_S
    area = sum(region.area_m2 for region in changes.regions)
    count = len(changes.regions)
    regions = (
        "no changed region"
        if not count
        else (f"{count} changed region{'s' if count > 1 else ''}, {square_metres(area)} in all")
    )
    detail = (
        f"In half of all scans at most {100 * np.nanmedian(changes.changed_share):.1f} %. "
        f"Changed for {changed_s:.1f} s in all (over {100 * limits.changed_share:g} % for "
        f"{limits.changed_s:g} s); {regions}."
    )
    worst = sustained_peak(changes.t_ns, changes.changed_share, limits.changed_s)
    peak = int(changes.t_ns[np.nanargmax(changes.changed_share)])
    link = moment_link(post, peak) if changed_s > 0.0 else ""
    return Fact(f"{100 * worst:.1f} %", label, detail, alarming=changed_s > 0.0, link=link)


def _hindsight(post: Postmortem) -> Fact:
    label = "how well hindsight knows where it was (1 sigma)"
    hindsight = post.hindsight
    if hindsight is None:
        lacks = "a map" if post.grid is None else "scans"
        return Fact("none", label, f"It needs {lacks}, which this log does not have.")
    detail = f"{100 * hindsight.coverage:.0f} % of the scans have a place in the map"
    if not hindsight.coverage:
        detail += "."
    elif hindsight.margin is None:
        detail += "; no other place explains them as well."
    else:
        detail += (
            "; the best other place explains them worse by "
            f"{hindsight.margin:.2f} in mean score (0 to 1)."
        )
    known = np.isfinite(hindsight.sigma_m)
    number = f"±{_length(hindsight.sigma_m)}" if known else "unknown"
    return Fact(number, label, detail)


def sustained_peak(t_ns: np.ndarray, share: np.ndarray, seconds: float) -> float:
    """The largest share that half of the scans of some `seconds` reach: one scan is no stretch."""
    known = np.isfinite(share)
    t, y = t_ns[known], share[known]
    ends = np.searchsorted(t, t + int(seconds * NS_PER_S), side="right")
    starts = np.arange(len(t))
    full = [k for k in starts.tolist() if t[-1] - t[k] >= seconds * NS_PER_S] or [0]
    return float(max(np.median(y[k : ends[k]]) for k in full))


def _length(metres: float) -> str:
    if metres < 0.995:
        return f"{100 * metres:.0f} cm"
    return f"{metres:.2f} m" if metres < 9.995 else f"{metres:.1f} m"
