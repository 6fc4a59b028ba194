"""The verdict: one log's belief against hindsight, and what the robot did with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.actions import Outcome, actions, risky
from slamreplay.verdict.case import Case
from slamreplay.verdict.contract import contract_findings
from slamreplay.verdict.failure_mode import failure_mode
from slamreplay.verdict.findings import motion_findings, verdict_findings
from slamreplay.verdict.intervals import log_state
from slamreplay.verdict.judgement import FailureMode, Interval, Judgement, State
from slamreplay.verdict.lacking import lacking
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.map_fit import map_fit
from slamreplay.verdict.stops import stop_findings, stops
from slamreplay.verdict.summary import summary
from slamreplay.verdict.tiles import Evidence, gathered, intervals_of
from slamreplay.verdict.timing import Delay, scan_delay
from slamreplay.verdict.unjudged import unjudged
from slamreplay.verdict.weak_evidence import doubt_of_map
from slamreplay.verdict.wheels import Wheels, wheels

_DEFAULT = Limits()


def judge(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight | None,
    limits: Limits = _DEFAULT,
) -> Judgement:
    """Was it lost, or had the world changed?

    The covariance alone decides nothing: lost is the belief's distance from hindsight, changed is
    what the scans, cast from there, contradict. Where hindsight itself cannot be trusted the moment
    is not judged.

    Args:
        view: the log; references that only judge are not in it.
        belief: base in map at every scan as the robot believed it, None where no localizer spoke.
        hindsight: where it really was, None without a map or without scans.
        limits: thresholds.
    """
    if belief is not None and not belief.has_pose.any():
        belief = None
    if hindsight is None or not len(hindsight.track):
        return unjudged(view, belief, hindsight, limits)
    fit = map_fit(view, hindsight, limits)
    if not fit.fits:
        return unjudged(view, belief, hindsight, limits, fit=fit)
    if hindsight.margin is not None and hindsight.margin < limits.margin:
        return unjudged(view, belief, hindsight, limits, ambiguous=True)
    delay = scan_delay(view, hindsight)
    evidence = gathered(view, belief, hindsight, limits, delay)
    intervals = intervals_of(view, evidence, limits)
    state = log_state(intervals, limits)
    turned = wheels(view, evidence.error)
    mode = _mode(view, belief, hindsight, evidence, intervals, limits, delay, turned)
    found_stops = stops(view, belief, hindsight.track, intervals, mode)
    done = actions(view, belief, limits, Outcome(evidence.error, intervals))
    reason = "hindsight does not know where it was for most of the log"
    doubt = doubt_of_map(view, evidence.changes, evidence.offset, limits)
    if doubt is not None and mode.kind == "stale_map_use":
        mode = replace(mode, evidence=(*mode.evidence, doubt))
    text = summary(
        state,
        intervals,
        mode,
        found_stops,
        evidence.changes,
        evidence.offset,
        start_ns=view.manifest.start_ns,
        has_belief=belief is not None,
        reason=reason,
        doubt=doubt,
    )
    findings = (
        *verdict_findings(view, belief, hindsight, intervals, evidence.offset, limits),
        *motion_findings(view, delay, turned),
        *risky(done),
        *contract_findings(done),
        *stop_findings(found_stops, view.manifest.start_ns),
    )
    sure = _log_confidence(state, intervals)
    offset = evidence.offset
    return Judgement(
        state,
        sure,
        text,
        intervals,
        mode,
        found_stops,
        done,
        findings,
        offset if offset is not None and offset.cause == "map" else None,
        lacking(view, belief, hindsight, delay),
    )


def _mode(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight,
    evidence: Evidence,
    intervals: tuple[Interval, ...],
    limits: Limits,
    delay: Delay | None,
    turned: Wheels | None,
) -> FailureMode:
    offset = evidence.offset
    if offset is not None and offset.cause == "map":
        spread = f"nine of ten moments within {offset.spread_m:.2f} m of it"
        words = (
            f"belief and map differ by one constant transform, {offset.text}: {spread}",
            "no drift added up: the localizer kept correcting itself in the map it had",
        )
        return FailureMode("wrong_map", 0.9, words)
    error = evidence.error
    sigma = np.full(len(error.t_ns), np.nan)
    own = True
    if belief is not None:
        told = recorded_belief(view, belief.t_ns)
        own = told is not None and np.array_equal(told.xyyaw, belief.xyyaw, equal_nan=True)
        cov = belief.at(error.t_ns).cov[:, :2, :2]
        u = (error.belief - error.where)[:, :2]
        u = u / np.maximum(np.hypot(u[:, 0], u[:, 1]), 1e-9)[:, None]
        with np.errstate(invalid="ignore"):
            sigma = np.sqrt(np.einsum("ni,nij,nj->n", u, cov, u))
    mode = failure_mode(Case(view, error, hindsight, intervals, sigma, limits, delay, turned, own))
    if offset is not None and offset.cause == "map_or_start" and mode.kind != "none":
        text = f"a map frame shifted by {offset.text} would explain it equally well"
        mode = replace(mode, confidence=0.5, evidence=(*mode.evidence, text))
    return mode


def _log_confidence(state: State, intervals: tuple[Interval, ...]) -> float | None:
    """The mean of the intervals that made the state, each by its length; None if undecided."""
    if state in ("insufficient_data", "unobservable"):
        return None
    wants = {
        "lost": ("lost", "lost_and_map_changed"),
        "map_changed": ("map_changed", "lost_and_map_changed"),
        "lost_and_map_changed": ("lost", "map_changed", "lost_and_map_changed"),
        "healthy": ("healthy",),
    }[state]
    made = [(i.confidence, i.duration_ns) for i in intervals if i.state in wants]
    sure = [(c, weight) for c, weight in made if c is not None]
    if not sure:
        return None
    return sum(c * weight for c, weight in sure) / sum(weight for _, weight in sure)
