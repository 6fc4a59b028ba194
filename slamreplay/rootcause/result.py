"""What could have caused an incident, ranked by how well it reproduces what was seen."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.verdict.judgement import FailureKind


@dataclass(frozen=True)
class Candidate:
    """One cause that was tried.

    Attributes:
        kind: the failure mode it stands for.
        perturbation: `NAME.VARIANT` that was put into the healed evidence, None for what no
            perturbation stands for.
        level: that reproduces best, in `unit`.
        unit: of the level.
        start_ns: from when on it acted, None for all along.
        log_likelihood: of what was seen, in nats; only differences mean anything.
        probability: of the candidate among those that were tried, calibrated; they sum to 1.
        text: what it did, as one sentence with numbers.
    """

    kind: FailureKind
    perturbation: str | None
    level: float | None
    unit: str
    start_ns: int | None
    log_likelihood: float
    probability: float
    text: str


@dataclass(frozen=True)
class RootCause:
    """The answer for one incident.

    Attributes:
        start_ns: when the belief left the truth, or the map stopped being true.
        end_ns: how long the incident was looked at.
        began_as: how the failure began.
        probability: of all candidates of that kind together, calibrated.
        candidates: the most probable first.
        trials: replays it took.
        reason: why there is no answer; empty where there is one.
    """

    start_ns: int
    end_ns: int
    began_as: FailureKind
    probability: float | None
    candidates: tuple[Candidate, ...]
    trials: int
    reason: str = ""
