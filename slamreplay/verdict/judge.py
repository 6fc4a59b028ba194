"""The verdict: one log's belief against hindsight, and what the robot did with it."""

from __future__ import annotations

from dataclasses import replace

from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.actions import Outcome, actions, risky
from slamreplay.verdict.apart import judged_apart
from slamreplay.verdict.contract import contract_findings
from slamreplay.verdict.findings import motion_findings, verdict_findings
from slamreplay.verdict.intervals import log_confidence, log_state
from slamreplay.verdict.judgement import FailureMode, Judgement
from slamreplay.verdict.lacking import lacking
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.looked_at import looked_at
from slamreplay.verdict.map_course import map_course_findings
from slamreplay.verdict.stops import stop_findings, stops
from slamreplay.verdict.summary import summary
from slamreplay.verdict.unjudged import unjudged
from slamreplay.verdict.weak_evidence import doubt_of_map

_DEFAULT = Limits()


def judge(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight | None,
    limits: Limits = _DEFAULT,
    began: FailureMode | None = None,
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
        began: how it began to fail, where that is known better than the evidence tells by itself.
    """
    if belief is not None and not belief.has_pose.any():
        belief = None
    if hindsight is None or not len(hindsight.track):
        return unjudged(view, belief, hindsight, limits)
    if hindsight.parts:
        return judged_apart(view, belief, hindsight, limits, began)
    looked = looked_at(view, belief, hindsight, limits)
    evidence, mode, delay = looked.evidence, began or looked.mode, looked.delay
    if evidence is None:
        fit, ambiguous = looked.fit, looked.fit is None
        return unjudged(view, belief, hindsight, limits, fit=fit, ambiguous=ambiguous)
    intervals = looked.intervals
    state = log_state(intervals, limits)
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
        *map_course_findings(view),
        *motion_findings(view, delay, looked.turned),
        *risky(done),
        *contract_findings(done),
        *stop_findings(found_stops, view.manifest.start_ns),
    )
    sure = log_confidence(state, intervals)
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
