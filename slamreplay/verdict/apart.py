"""The verdict over a log whose maps were of several places: each stretch by itself, then joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.actions import Outcome, actions, risky
from slamreplay.verdict.belief_error import BeliefError, belief_error
from slamreplay.verdict.contract import contract_findings
from slamreplay.verdict.findings import motion_findings, verdict_findings
from slamreplay.verdict.intervals import joined, log_confidence, log_state
from slamreplay.verdict.judgement import FailureMode, Judgement
from slamreplay.verdict.lacking import lacking
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.looked_at import Looked, looked_at
from slamreplay.verdict.map_course import map_course_findings
from slamreplay.verdict.stops import stop_findings, stops
from slamreplay.verdict.summary import summary


def judged_apart(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight,
    limits: Limits,
    began: FailureMode | None = None,
) -> Judgement:
    """Intervals, causes and offsets of each stretch; stops and actions of the whole log.

    A belief in the frame of one map says nothing of a map in another frame: there lost is not
    judged.

    Args:
        view: the whole log.
        belief: as in `judge`.
        hindsight: with the parts it was joined from.
        limits: thresholds.
        began: as in `judge`.
    """
    looked: list[Looked] = []
    errors: list[BeliefError] = []
    findings = list(map_course_findings(view))
    for part in hindsight.parts:
        stretch = view.within(part.stretch)
        own = belief if _same_frame(view, stretch) else None
        found = looked_at(stretch, own, part.hindsight, limits)
        looked.append(found)
        evidence = found.evidence
        errors.append(
            belief_error(own, part.hindsight, limits) if evidence is None else evidence.error
        )
        offset = None if evidence is None else evidence.offset
        findings += verdict_findings(
            stretch, belief, part.hindsight, found.intervals, offset, limits, found.fit
        )
        findings += motion_findings(stretch, found.delay, found.turned)
    intervals = joined([found.intervals for found in looked])
    state = log_state(intervals, limits)
    mode = began or _mode(looked)
    found_stops = stops(view, belief, hindsight.track, intervals, mode)
    done = actions(view, belief, limits, Outcome(_joined(errors), intervals))
    start_ns = view.manifest.start_ns
    text = summary(
        state,
        intervals,
        mode,
        found_stops,
        hindsight.changes,
        None,
        start_ns=start_ns,
        has_belief=belief is not None,
        reason=_reason(looked),
    )
    findings += [
        *risky(done),
        *contract_findings(done),
        *stop_findings(found_stops, start_ns),
    ]
    delays = [found.delay for found in looked if found.delay is not None]
    return Judgement(
        state,
        log_confidence(state, intervals),
        text,
        intervals,
        mode,
        found_stops,
        done,
        tuple(dict.fromkeys(findings)),
        lacking=lacking(view, belief, hindsight, delays[0] if delays else None),
    )


def _same_frame(view: BundleView, stretch: BundleView) -> bool:
    """Whether the belief is in the frame of a stretch's map, as far as the maps' frames differ."""
    grids = [view.grid_of(s.version) for s in view.map_stretches]
    frames = {grid.frame_id for grid in grids if grid is not None}
    told = view.manifest.frames.map
    return told not in frames or stretch.grid is None or stretch.grid.frame_id == told


def _mode(looked: Sequence[Looked]) -> FailureMode:
    """Of the stretch that was lost longest; of none that was, changed longest; else any."""

    def weight(found: Looked) -> tuple[int, int, bool]:
        lost = sum(i.duration_ns for i in found.intervals if i.is_lost)
        changed = sum(i.duration_ns for i in found.intervals if i.is_changed)
        return lost, changed, found.mode.kind != "none"

    return max(looked, key=weight).mode


def _reason(looked: Sequence[Looked]) -> str:
    """Why most of what cannot be judged cannot."""
    unjudged = [found for found in looked if found.reason]
    if not unjudged:
        return "hindsight does not know where it was for most of the log"
    return max(unjudged, key=lambda f: f.intervals[-1].end_ns - f.intervals[0].start_ns).reason


def _joined(errors: Sequence[BeliefError]) -> BeliefError:
    names = BeliefError.__dataclass_fields__
    return BeliefError(**{n: np.concatenate([getattr(e, n) for e in errors]) for n in names})
