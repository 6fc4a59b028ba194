"""Put the checks to a log's belief and to the runs on it, and correct for how many were asked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from slamreplay.bundle.findings import Finding
from slamreplay.consistency import ABOUT_BELIEF, CHECKS
from slamreplay.consistency.answers import Answer, Suspicion, raised
from slamreplay.consistency.context import CheckContext


def ask(contexts: Sequence[CheckContext], names: Iterable[str] | None = None) -> list[Finding]:
    """What the checks find, with p-values corrected over all of it after Holm; see `answered`."""
    return list(raised(answered(contexts, names)))


def answered(
    contexts: Sequence[CheckContext], names: Iterable[str] | None = None
) -> tuple[Answer, ...]:
    """All that the checks answer, facts and suspicions, before any correction.

    Args:
        contexts: the log with the robot's own belief, and runs of estimators on it; runs are only
            asked what concerns a belief, and what is found of them is told with their name.
        names: of checks; all by default.

    Raises:
        UsageError: there is no check of such a name.
    """
    chosen = tuple(CHECKS if names is None else names)
    answers: list[Answer] = []
    for context in contexts:
        for name in chosen:
            if not context.subject or name in ABOUT_BELIEF:
                answers += (_told(answer, context.subject) for answer in CHECKS.load(name)(context))
    return tuple(answers)


def _told(answer: Answer, subject: str) -> Answer:
    if not subject:
        return answer
    if isinstance(answer, Suspicion):
        return Suspicion(_named(answer.finding, subject), answer.p_value)
    return _named(answer, subject)


def _named(finding: Finding, subject: str) -> Finding:
    return replace(finding, message=f"{subject}: {finding.message}")
