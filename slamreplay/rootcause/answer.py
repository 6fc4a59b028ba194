"""The question asked of one log: which single thing, put back, reproduces what was seen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.rootcause import of_filter, of_motion, of_sensing
from slamreplay.rootcause.healing import Healed, healed
from slamreplay.rootcause.incident import Incident, incident_of
from slamreplay.rootcause.likelihood import log_likelihood, moments
from slamreplay.rootcause.replays import Replay, replayed
from slamreplay.rootcause.result import Candidate, RootCause
from slamreplay.rootcause.trial import Trial
from slamreplay.verdict.judgement import ConstantOffset
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.looked_at import Looked, looked_at

#: Replays of each trial, with different random numbers.
SEEDS = 3


@dataclass(frozen=True, eq=False)
class Tried:
    """A trial and what came of it."""

    trial: Trial
    replays: tuple[Replay, ...]
    log_likelihood: float


def root_cause(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight | None,
    limits: Limits | None = None,
) -> RootCause | None:
    """What the failure of a log began with; None where nothing failed, or nothing can be told.

    Args:
        view: the log.
        belief: base in map as the robot believed it.
        hindsight: where it really was.
        limits: what counts as lost.
    """
    limits = Limits() if limits is None else limits
    if belief is None or hindsight is None or not len(hindsight.track):
        return None
    looked = looked_at(view, belief, hindsight, limits)
    if looked.case is None:
        return None
    incident = incident_of(looked.case, belief, limits)
    if incident is None:
        return None
    put_right = healed(incident, AmclConfig())
    if put_right is None:
        return None
    tried = tried_of(incident, put_right, looked)
    return _answer(incident, put_right, tried)


def tried_of(incident: Incident, put_right: Healed, looked: Looked) -> list[Tried]:
    """Every trial replayed and weighed; the control, with nothing put back, comes first."""
    rows = moments(incident)
    offset = None if looked.evidence is None else looked.evidence.offset
    control = Trial("", "none", None, "", None, "nothing", put_right.evidence)
    out = []
    for trial in (control, *_trials(incident, put_right, offset)):
        replays = _replays(trial)
        value = log_likelihood(incident, put_right.truth, replays, rows)
        out.append(Tried(trial, replays, value))
    return out


def _trials(
    incident: Incident, put_right: Healed, offset: ConstantOffset | None
) -> Iterator[Trial]:
    yield from of_motion.starts(incident, put_right)
    yield from of_motion.motions(incident, put_right)
    yield from of_sensing.clocks(incident, put_right)
    yield from of_sensing.gaps(incident, put_right)
    yield from of_sensing.people(put_right)
    yield from of_sensing.maps(incident, put_right, offset)
    yield from of_filter.trusts(incident, put_right)
    yield from of_filter.uncorrected(incident, put_right)
    yield from of_filter.jumps(incident, put_right)


def _replays(trial: Trial) -> tuple[Replay, ...]:
    if trial.evidence is None:
        assert trial.belief is not None
        return (Replay(trial.belief, np.full(len(trial.belief), np.nan), 0),)
    return tuple(replayed(trial.evidence, seed) for seed in range(SEEDS))


def _answer(incident: Incident, put_right: Healed, tried: list[Tried]) -> RootCause:
    values = np.array([one.log_likelihood for one in tried])
    chance = np.exp(values - values.max())
    chance /= chance.sum()
    order = np.argsort(-values, kind="stable")
    candidates = tuple(
        _candidate(incident, put_right, tried[k], float(chance[k])) for k in order.tolist()
    )
    kind = candidates[0].kind
    of_kind = sum(c.probability for c in candidates if c.kind == kind)
    return RootCause(
        incident.onset_ns,
        int(incident.t_ns[-1]),
        kind,
        min(of_kind, 1.0),
        candidates,
        sum(len(one.replays) for one in tried if one.trial.evidence is not None),
    )


def _candidate(incident: Incident, put_right: Healed, one: Tried, chance: float) -> Candidate:
    trial = one.trial
    start = None if trial.row is None else int(incident.t_ns[trial.row])
    text = _text(incident, put_right, one)
    name = trial.name or None
    return Candidate(
        trial.kind, name, trial.level, trial.unit, start, one.log_likelihood, chance, text
    )


def _text(incident: Incident, put_right: Healed, one: Tried) -> str:
    rows = moments(incident)
    seen = _far(incident.belief[rows], put_right.truth[rows])
    made = np.array([_far(r.xyyaw[rows], put_right.truth[rows]).max() for r in one.replays])
    return (
        f"{one.trial.words} takes the belief up to {np.median(made):.2f} m off, "
        f"seen {seen.max():.2f} m"
    )


def _far(poses: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.hypot(*(poses - truth)[:, :2].T))
