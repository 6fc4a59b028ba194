"""What `slamreplay gate` prints: a line for each log, what failed, and the gate's own verdict."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from slamreplay.cli.terminal import say, say_table
from slamreplay.gate.failures import failures, span_s
from slamreplay.gate.result_file import counted

if TYPE_CHECKING:
    from slamreplay.cli.columns import Cell, Tone
    from slamreplay.gate.outcome import GatedLog, GateResult, Status

#: More failures, and more checks that were skipped, are in the files.
_MOST, _MOST_SKIPPED = 40, 12
_TONES: dict[Status, Tone] = {
    "passed": "good",
    "skipped": "doubt",
    "failed": "bad",
    "error": "bad",
}
_WORDS: dict[Status, str] = {
    "passed": "passed",
    "skipped": "not assessable",
    "failed": "FAILED",
    "error": "UNREADABLE",
}


def show_result(result: GateResult) -> None:
    """Print it."""
    say((result.question, "head"))
    head: list[Cell] = ["", "log", "state", "passed", "failed", "skipped"]
    say_table([head, *map(_row, result.logs)], numbers=range(3, 6))
    _show_skipped(result)
    _show_failures(result)
    tone: Tone = "bad" if result.exit_code else "good"
    words = {0: "The gate passes", 1: "The gate fails", 2: "A log could not be read"}
    counts = Counter(log.status for log in result.single)
    told = ", ".join(f"{counts[s]} {_WORDS[s].lower()}" for s in _WORDS if counts[s])
    say()
    say((words[result.exit_code], tone), f": {told} ({result.recipe})")


def _row(log: GatedLog) -> list[Cell]:
    counts = counted(log.outcomes)
    return [
        (_WORDS[log.status], _TONES[log.status]),
        log.log,
        log.state or ("-" if log.status == "error" else "all logs"),
        str(counts["passed"]),
        str(counts["failed"] + counts["error"]),
        str(counts["skipped"]),
    ]


def _show_skipped(result: GateResult) -> None:
    """A line for each check that some log did not let be assessed, with the first reason."""
    reasons: dict[str, list[str]] = {}
    for log in result.logs:
        for outcome in log.outcomes:
            if outcome.status == "skipped":
                reasons.setdefault(outcome.check, []).append(outcome.message)
    if reasons:
        say()
    for check, told in list(reasons.items())[:_MOST_SKIPPED]:
        more = f" (and {len(told) - 1} more)" if len(told) > 1 else ""
        say(("? ", "doubt"), (f"{check} skipped: {told[0]}{more}", "quiet"), indent=2)
    if len(reasons) > _MOST_SKIPPED:
        say((f"{len(reasons) - _MOST_SKIPPED} more checks were skipped", "quiet"))


def _show_failures(result: GateResult) -> None:
    found = failures(result)
    for failure in found[:_MOST]:
        outcome = failure.outcome
        say()
        when = " to ".join(span_s(failure.log, outcome))
        where = f" at {when} s" if when else ""
        say(("! ", "bad"), (failure.log.log, "head"), f" {outcome.check}{where}", indent=2)
        say("  ", outcome.message, indent=2)
    if len(found) > _MOST:
        say()
        say((f"{len(found) - _MOST} more, of which the files tell", "quiet"))
