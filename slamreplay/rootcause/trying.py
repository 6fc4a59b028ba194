"""Every trial of an incident, replayed and weighed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from slamreplay.geometry import se2
from slamreplay.rootcause import of_filter, of_motion, of_sensing
from slamreplay.rootcause.healing import Healed
from slamreplay.rootcause.incident import Incident
from slamreplay.rootcause.likelihood import log_likelihood, moments
from slamreplay.rootcause.replays import Replay, replayed
from slamreplay.rootcause.trial import Trial
from slamreplay.verdict.judgement import ConstantOffset
from slamreplay.verdict.looked_at import Looked


@dataclass(frozen=True, eq=False)
class Tried:
    """A trial and what came of it.

    Attributes:
        trial: what was put back.
        replays: with different random numbers.
        log_likelihood: of what was seen, the dose's own odds in it, nats.
    """

    trial: Trial
    replays: tuple[Replay, ...]
    log_likelihood: float


def tried_of(incident: Incident, put_right: Healed, looked: Looked) -> list[Tried]:
    """Every trial replayed; the control, with nothing put back, comes first."""
    rows = moments(incident)
    offset = None if looked.evidence is None else looked.evidence.offset
    control = Trial("", "none", None, "", None, "nothing put back", put_right.evidence)
    out: list[Tried] = []
    for trial in (control, *_trials(incident, put_right, offset)):
        same = [one for one in out if trial.evidence and one.trial.evidence is trial.evidence]
        replays = same[0].replays if same else _replays(trial, incident)
        value = log_likelihood(incident, put_right.truth, replays, rows)
        out.append(Tried(trial, replays, value + trial.log_dose))
    return out


def _trials(
    incident: Incident, put_right: Healed, offset: ConstantOffset | None
) -> Iterator[Trial]:
    yield from of_motion.starts(incident, put_right)
    yield from of_motion.set_poses(incident, put_right)
    yield from of_motion.motions(incident, put_right)
    yield from of_sensing.clocks(incident, put_right)
    yield from of_sensing.gaps(incident, put_right)
    yield from of_sensing.people(incident, put_right)
    yield from of_sensing.maps(incident, put_right, offset)
    yield from of_filter.trusts(incident, put_right)
    yield from of_filter.uncorrected(incident, put_right)
    yield from of_filter.jumps(incident, put_right)


def _replays(trial: Trial, incident: Incident) -> tuple[Replay, ...]:
    if trial.evidence is None:
        assert trial.belief is not None
        return (Replay(trial.belief, np.full(len(trial.belief), np.nan), 0, by_chance=False),)
    found = (replayed(trial.evidence, seed) for seed in range(trial.seeds))
    if not trial.late_ns:
        return tuple(found)
    t_ns = incident.t_ns
    earlier = np.maximum(t_ns - trial.late_ns, t_ns[0])
    return tuple(replace(one, xyyaw=se2.interpolate(t_ns, one.xyyaw, earlier)) for one in found)
