"""junit.xml of a gate: a suite for each log, a test case for each check."""

from __future__ import annotations

from collections import Counter
from typing import Literal

from slamreplay.evidence.clean import clean, one_line, straight
from slamreplay.gate.failures import span_s
from slamreplay.gate.outcome import GatedLog, GateResult, Outcome, Status
from slamreplay.report.junit_suites import Case, Suite, junit_text

# GitLab takes files below 30 MB; both are far more than anybody reads.
_MESSAGE_LETTERS = 1_000
_TEXT_LETTERS = 4_000

_ENDED: dict[Status, Literal["failure", "error", "skipped"] | None] = {
    "passed": None, "failed": "failure", "skipped": "skipped", "error": "error",
}  # fmt: skip


def junit_xml(result: GateResult) -> str:
    """The file's text; the same result gives the same bytes.

    A check that failed is a `failure`, one that the log does not let be assessed is `skipped`, and
    a log that could not be read is an `error`. What a passed check found is its output.
    """
    seen: Counter[tuple[str, str]] = Counter()
    return junit_text([_suite(log, result, seen) for log in result.logs])


def _suite(log: GatedLog, result: GateResult, seen: Counter[tuple[str, str]]) -> Suite:
    told = {"recipe": result.recipe, "state": log.state or "", "report": log.report or ""}
    properties = {"summary": one_line(log.summary, _MESSAGE_LETTERS)}
    properties |= {name: straight(value) for name, value in told.items() if value}
    shown, cases = straight(clean(log.log)), []
    for outcome in log.outcomes:
        name = one_line(f"{outcome.check} {outcome.title}", _MESSAGE_LETTERS)
        seen[shown, name] += 1
        # GitLab drops a second case of the same name.
        again = f" ({seen[shown, name]})" if seen[shown, name] > 1 else ""
        cases.append(_case(name + again, log, outcome))
    return Suite(shown, cases, properties)


def _case(name: str, log: GatedLog, outcome: Outcome) -> Case:
    ended = _ENDED[outcome.status]
    message = one_line(outcome.message, _MESSAGE_LETTERS)
    if ended is None or ended == "skipped":
        return Case(name, ended, message=message, text=message if ended is None else "")
    lines = [f"{outcome.severity}: {one_line(outcome.message, _TEXT_LETTERS)}"]
    if span := span_s(log, outcome):
        lines.append(f"from {' to '.join(span)} s of the log")
    if outcome.value is not None and outcome.limit is not None:
        unit = one_line(outcome.unit, _MESSAGE_LETTERS)
        lines.append(f"{outcome.value:.6g} against {outcome.limit:.6g} {unit}".rstrip())
    return Case(name, ended, outcome.check, message, "\n".join(lines))
