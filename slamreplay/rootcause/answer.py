"""The question asked of one log: which single thing, put back, reproduces what was seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.rootcause.calibration import Calibration, key_of, shipped_calibration
from slamreplay.rootcause.healing import Healed, healed
from slamreplay.rootcause.incident import Incident, incident_of
from slamreplay.rootcause.likelihood import moments
from slamreplay.rootcause.result import Candidate, RootCause
from slamreplay.rootcause.trying import Tried, tried_of
from slamreplay.verdict.belief_error import belief_error
from slamreplay.verdict.judgement import FailureKind, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.looked_at import Looked, looked_at

#: What only odometry can show in a replay.
_OF_MOTION = ("kidnapped", "odometry_slip", "optimization_drift")


def root_cause(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight | None,
    limits: Limits | None = None,
    calibration: Calibration | None = None,
) -> RootCause | None:
    """What the failure of a log began with.

    Args:
        view: the log.
        belief: base in map as the robot believed it.
        hindsight: where it really was.
        limits: what counts as lost and as changed.
        calibration: from likelihoods to probabilities; the shipped one by default.

    Returns:
        None where nothing failed. Where something did and nothing can be tried, the answer has the
        verdict's failure mode and says why.
    """
    limits = Limits() if limits is None else limits
    weights = shipped_calibration() if calibration is None else calibration
    if hindsight is None or not len(hindsight.track):
        return None
    if not hindsight.parts:
        return _of(view, belief, hindsight, limits, weights)
    found = []
    for part in hindsight.parts:
        one = _of(view.within(part.stretch), belief, part.hindsight, limits, weights)
        found += [] if one is None else [one]
    return max(found, key=lambda one: len(one.candidates), default=None)


def _of(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight,
    limits: Limits,
    weights: Calibration,
) -> RootCause | None:
    """Of a log, or of a stretch of it with one map."""
    looked = looked_at(view, belief, hindsight, limits)
    found = _tried(looked, belief, hindsight, limits)
    if found is None:
        return _told(looked)
    incident, put_right, tried = found
    chance = weights.probabilities(tried, looked.mode.kind)
    answer = _answer(incident, put_right, tried, chance)
    return answer if incident.has_odometry else _without_odometry(answer, looked)


def trials_and_mode(
    view: BundleView, belief: PoseTrack | None, hindsight: Hindsight | None
) -> tuple[list[Tried], FailureKind] | None:
    """What a calibration is fitted to: the trials, and what the verdict says without them."""
    if hindsight is None or not len(hindsight.track) or hindsight.parts:
        return None
    looked = looked_at(view, belief, hindsight, Limits())
    found = _tried(looked, belief, hindsight, Limits())
    return None if found is None else (found[2], looked.mode.kind)


def _tried(
    looked: Looked, belief: PoseTrack | None, hindsight: Hindsight, limits: Limits
) -> tuple[Incident, Healed, list[Tried]] | None:
    incident = None if belief is None else _incident(looked, belief, hindsight, limits)
    put_right = None if incident is None else healed(incident, AmclConfig())
    if incident is None or put_right is None:
        return None
    return incident, put_right, tried_of(incident, put_right, looked)


def _incident(
    looked: Looked, belief: PoseTrack, hindsight: Hindsight, limits: Limits
) -> Incident | None:
    """The loss; of a belief in a map that lies elsewhere, its whole stretch."""
    case = looked.case
    if case is None:
        return None
    offset = None if looked.evidence is None else looked.evidence.offset
    if offset is not None and offset.cause == "map":
        whole = Interval("lost", *case.view.span)
        error = belief_error(belief, hindsight, limits)
        case = replace(case, error=error, intervals=(whole,))
    return incident_of(case, belief, limits)


def _told(looked: Looked) -> RootCause | None:
    """What the verdict says of a failure that no replay of a filter can show."""
    mode, case = looked.mode, looked.case
    failed = case is None or any(i.is_lost or i.is_changed for i in looked.intervals)
    if mode.kind == "none" or not failed:
        return None
    bad = [i for i in looked.intervals if i.is_lost or i.is_changed] or list(looked.intervals)
    text = "; ".join(mode.evidence)
    probability = 1.0 if mode.confidence is None else mode.confidence
    name, level, unit = _dose(looked)
    only = Candidate(mode.kind, name, level, unit, None, 0.0, probability, text)
    reason = "" if case is not None else looked.reason
    start, end = bad[0].start_ns, bad[-1].end_ns
    return RootCause(start, end, mode.kind, probability, (only,), 0, reason)


def _dose(looked: Looked) -> tuple[str | None, float | None, str]:
    """Perturbation, level and unit of what harmed the map alone."""
    case, kind = looked.case, looked.mode.kind
    if case is None or kind != "stale_map_use":
        return None, None, ""
    return "map_stale.versions", 1.0, "ratio"


def _answer(
    incident: Incident, put_right: Healed, tried: list[Tried], chance: list[float]
) -> RootCause:
    """One candidate per kind and perturbation: of several levels the one that fits best."""
    groups: dict[str, list[int]] = {}
    for k, one in enumerate(tried):
        groups.setdefault(key_of(one), []).append(k)
    found = []
    for rows in groups.values():
        best = max(rows, key=lambda k: chance[k])
        p = sum(chance[k] for k in rows)
        found.append(_candidate(incident, put_right, tried, best, p))
    found.sort(key=lambda one: -one.probability)
    by_kind: dict[FailureKind, float] = {}
    for each in found:
        by_kind[each.kind] = by_kind.get(each.kind, 0.0) + each.probability
    kind = max(by_kind, key=lambda k: by_kind[k])
    replays = {id(replay) for one in tried for replay in one.replays if replay.by_chance}
    start, end = incident.onset_ns, int(incident.t_ns[-1])
    return RootCause(start, end, kind, min(by_kind[kind], 1.0), tuple(found), len(replays))


def _without_odometry(answer: RootCause, looked: Looked) -> RootCause:
    """What is left of an answer that half of the causes could not be tried for."""
    reason = "the log has no odometry: slips, carries and drift could not be put back"
    if answer.began_as != "none":
        return replace(answer, reason=reason)
    mode = looked.mode
    kind: FailureKind = mode.kind if mode.kind in _OF_MOTION else "none"
    sure = mode.confidence if kind != "none" else None
    return replace(answer, began_as=kind, probability=sure, reason=reason)


def _candidate(
    incident: Incident, put_right: Healed, tried: list[Tried], k: int, chance: float
) -> Candidate:
    one = tried[k]
    trial = one.trial
    rows = moments(incident)
    truth = put_right.truth[rows]
    seen = _furthest(incident.belief[rows], truth)
    made, without = (
        float(np.median([_furthest(r.xyyaw[rows], truth) for r in each.replays]))
        for each in (one, tried[0])
    )
    text = f"with {trial.words}, the belief gets {made:.2f} m off"
    text += "" if k == 0 else f", without it {without:.2f} m"
    start = None if trial.row is None else int(incident.t_ns[trial.row])
    return Candidate(
        trial.kind,
        trial.name or None,
        trial.level,
        trial.unit,
        start,
        one.log_likelihood,
        chance,
        f"{text}; seen: {seen:.2f} m",
    )


def _furthest(poses: np.ndarray, truth: np.ndarray) -> float:
    return float(np.hypot(*(poses - truth)[:, :2].T).max(initial=0.0))
