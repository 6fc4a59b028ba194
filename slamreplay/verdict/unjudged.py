"""The judgement where nothing can be judged: one interval that says why."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.actions import actions, risky
from slamreplay.verdict.contract import contract_findings
from slamreplay.verdict.findings import verdict_findings
from slamreplay.verdict.judgement import FailureMode, Interval, Judgement, State
from slamreplay.verdict.lacking import lacking
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.map_course import map_course_findings
from slamreplay.verdict.map_fit import MapFit
from slamreplay.verdict.stops import stop_findings, stops
from slamreplay.verdict.summary import summary


def unjudged(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight | None,
    limits: Limits,
    *,
    fit: MapFit | None = None,
    ambiguous: bool = False,
) -> Judgement:
    """The judgement of a log of which nothing can be said; what the robot did still stands.

    Args:
        view: the log.
        belief: as in `judge`.
        hindsight: None without a map or without scans.
        limits: thresholds.
        fit: how badly the scans fit this map; None where that was not asked.
        ambiguous: whether several places explain all scans: unobservable.
    """
    told = why_unjudged(view, hindsight, fit, ambiguous=ambiguous)
    whole = (told.interval,)
    state, mode, start = told.interval.state, told.mode, view.manifest.start_ns
    found_stops = stops(view, belief, None, whole)
    done = actions(view, belief, limits)
    text = summary(
        state,
        whole,
        mode,
        found_stops,
        None,
        None,
        start_ns=start,
        has_belief=belief is not None,
        reason=told.reason,
    )
    findings: tuple[Finding, ...] = (
        *verdict_findings(view, belief, hindsight, whole, None, limits, fit),
        *map_course_findings(view),
        *risky(done),
        *contract_findings(done),
        *stop_findings(found_stops, start),
    )
    left = lacking(view, belief, hindsight, None)
    return Judgement(state, None, text, whole, mode, found_stops, done, findings, lacking=left)


@dataclass(frozen=True)
class Unjudged:
    """One interval over the view's span, what could be the matter with it, and why in words."""

    interval: Interval
    mode: FailureMode
    reason: str


def why_unjudged(
    view: BundleView, hindsight: Hindsight | None, fit: MapFit | None, *, ambiguous: bool
) -> Unjudged:
    """Why nothing can be said of a log or a stretch of it; arguments as in `unjudged`."""
    state: State = "unobservable" if ambiguous else "insufficient_data"
    ids: tuple[str, ...] = ("SR-LOC-002",)
    reason = ""
    mode = FailureMode("none", None, ())
    if not ambiguous:
        ids, reason = ("SR-LOC-004",), "too few scans were recorded"
        if view.grid is None:
            ids, reason = ("SR-MAP-002",), "there is no map to compare with"
        elif hindsight is None:
            reason = "there are no scans to compare with the map"
        elif fit is not None:
            ids, reason = ("SR-MAP-WRONG",), "its scans fit nowhere in this map"
            words = ("no place in the map explains the scans: another floor, scale or building",)
            if fit.scale is not None:
                reason = fit.text
                words = (f"{fit.text}: laid out so much larger the scans fit it",)
            mode = FailureMode("wrong_map", 0.7, words)
    else:
        mode = FailureMode("sensing_ambiguity", 0.7, ("two places explain all scans equally well",))
    return Unjudged(Interval(state, *view.span, findings=ids), mode, reason)
