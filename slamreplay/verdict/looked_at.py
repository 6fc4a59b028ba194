"""What one stretch of a log shows: its intervals, and how it began to fail."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.case import Case
from slamreplay.verdict.failure_mode import failure_mode
from slamreplay.verdict.judgement import ConstantOffset, FailureMode, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.map_fit import MapFit, map_fit
from slamreplay.verdict.tiles import Evidence, gathered, intervals_of
from slamreplay.verdict.timing import Delay, scan_delay
from slamreplay.verdict.unjudged import why_unjudged
from slamreplay.verdict.wheels import Wheels, wheels


@dataclass(frozen=True, eq=False)
class Looked:
    """What a stretch shows.

    Attributes:
        intervals: tile its span.
        mode: how it began to fail.
        evidence: belief against hindsight; None where nothing can be judged.
        delay: between scans and odometry, None where it is not known.
        turned: odometry against hindsight, None without odometry.
        fit: how badly its scans fit the map, where that is why nothing can be judged.
        reason: why not, in words.
        case: what the mode was looked for in; None where nothing can be judged.
    """

    intervals: tuple[Interval, ...]
    mode: FailureMode
    evidence: Evidence | None
    delay: Delay | None = None
    turned: Wheels | None = None
    fit: MapFit | None = None
    reason: str = ""
    case: Case | None = None


def looked_at(
    view: BundleView, belief: PoseTrack | None, hindsight: Hindsight, limits: Limits
) -> Looked:
    """The stretch that the view is of, or the whole log.

    Args:
        view: the evidence.
        belief: base in map as believed, None where no localizer spoke.
        hindsight: where the robot really was in that stretch.
        limits: thresholds.
    """
    fit = map_fit(view, hindsight, limits)
    ambiguous = hindsight.margin is not None and hindsight.margin < limits.margin
    if not fit.fits or ambiguous:
        given = None if fit.fits else fit
        why = why_unjudged(view, hindsight, given, ambiguous=fit.fits)
        return Looked((why.interval,), why.mode, None, fit=given, reason=why.reason)
    delay = scan_delay(view, hindsight)
    evidence = gathered(view, belief, hindsight, limits, delay)
    intervals = intervals_of(view, evidence, limits)
    turned = wheels(view, evidence.error)
    case = _case(view, belief, hindsight, evidence, intervals, limits, delay, turned)
    mode = _mode(case, evidence.offset)
    return Looked(intervals, mode, evidence, delay, turned, case=case)


def _mode(case: Case, offset: ConstantOffset | None) -> FailureMode:
    if offset is not None and offset.cause == "map":
        spread = f"nine of ten moments within {offset.spread_m:.2f} m of it"
        words = (
            f"belief and map differ by one constant transform, {offset.text}: {spread}",
            "no drift added up: the localizer kept correcting itself in the map it had",
        )
        return FailureMode("wrong_map", 0.9, words)
    mode = failure_mode(case)
    if offset is not None and offset.cause == "map_or_start" and mode.kind != "none":
        text = f"a map frame shifted by {offset.text} would explain it equally well"
        mode = replace(mode, confidence=0.5, evidence=(*mode.evidence, text))
    return mode


def _case(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight,
    evidence: Evidence,
    intervals: tuple[Interval, ...],
    limits: Limits,
    delay: Delay | None,
    turned: Wheels | None,
) -> Case:
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
    return Case(view, error, hindsight, intervals, sigma, limits, delay, turned, own)
