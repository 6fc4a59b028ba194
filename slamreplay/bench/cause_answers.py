"""Those who name the root cause of a judged log, behind one interface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.judgement import FailureKind, Judgement


@dataclass(frozen=True, eq=False)
class JudgedLog:
    """What a cause is named from: nothing of the truth is in it.

    Attributes:
        view: the log.
        belief: as recorded, None where no localizer spoke.
        hindsight: None without a map or without scans.
        judgement: the verdict.
    """

    view: BundleView
    belief: PoseTrack | None
    hindsight: Hindsight | None
    judgement: Judgement


@dataclass(frozen=True)
class Answer:
    """A cause.

    Attributes:
        kind: named first.
        probability: that it is the right one, None where nothing was said of it.
        ranked: all kinds that were weighed with their probabilities, the most probable first.
        trials: replays it took.
        text: the evidence in words.
    """

    kind: FailureKind
    probability: float | None
    ranked: tuple[tuple[FailureKind, float], ...]
    trials: int = 0
    text: str = ""


Answerer = Callable[[JudgedLog], Answer]


def by_rules(log: JudgedLog) -> Answer:
    """The verdict's failure mode: read off the evidence, no replay."""
    mode = log.judgement.failure_mode
    ranked = () if mode.confidence is None else ((mode.kind, mode.confidence),)
    return Answer(mode.kind, mode.confidence, ranked, 0, "; ".join(mode.evidence))


def by_replays(log: JudgedLog) -> Answer:
    """The single thing that, put back into healed evidence, reproduces what was seen."""
    from slamreplay.rootcause.answer import root_cause

    found = root_cause(log.view, log.belief, log.hindsight)
    if found is None:
        return Answer("none", None, ())
    shares: dict[FailureKind, float] = {}
    for one in found.candidates:
        shares[one.kind] = shares.get(one.kind, 0.0) + one.probability
    ranked = tuple(sorted(shares.items(), key=lambda item: -item[1]))
    best = [one.text for one in found.candidates if one.kind == found.began_as][:1]
    text = "; ".join([*best, *([found.reason] if found.reason else [])])
    return Answer(found.began_as, found.probability, ranked, found.trials, text)


#: By the name that the command line takes.
ANSWERERS: dict[str, Answerer] = {"rules": by_rules, "replays": by_replays}
