"""The summary of a run in Markdown, as GitHub Actions shows it and GitLab renders it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from urllib.parse import quote

from slamreplay.evidence.clean import as_markdown, clean, one_line
from slamreplay.evidence.words import STATES
from slamreplay.gate.failures import Failure, failures, grouped, logs_of, told
from slamreplay.gate.outcome import STATUSES, GatedLog, GateResult, Status

#: GitHub refuses a summary of more than 1 MiB (all that one step wrote to it), and shows nothing.
MOST_BYTES = 1_000_000
_LETTERS = 300
_QUOTED = 5
#: Without room for these the tables are cut; the closing lines have theirs.
_CLOSING_BYTES = 2_000

_WORDS: dict[Status, str] = {
    "error": "could not be read", "failed": "failed",
    "skipped": "not assessable", "passed": "passed",
}  # fmt: skip


def step_summary(result: GateResult, *, artifacts: str | None = None) -> str:
    """Markdown of at most `MOST_BYTES` bytes; the same result gives the same text.

    What failed by check, then each log with its verdict and what failed on it, worst first. What
    does not fit is left out from the end, and counted.

    Args:
        result: of the gate.
        artifacts: address of a page where the reports can be had, linked once. None: each log
            links to its report, by its path from where the summary lies.
    """
    parts = [_head(result)]
    if artifacts:
        parts.append(
            f"The reports are among [the run's artifacts]({quote(artifacts, '/:?#=&%')}).\n"
        )
    room = MOST_BYTES - _CLOSING_BYTES - sum(_size(part) for part in parts)
    by_check = _by_check(failures(result), result)
    table, left_out = _table(("check", "severity", "logs", "what was found"), by_check, room // 4)
    if by_check:
        parts.append(f"### What failed\n\n{table}")
        parts += [_left_out(left_out, "check")] * bool(left_out)
    room = MOST_BYTES - _CLOSING_BYTES - sum(_size(part) for part in parts)
    logs = sorted(result.logs, key=lambda log: STATUSES.index(log.status))
    others = "Other logs" if by_check else "Logs"
    for title, statuses in (("Logs that failed", STATUSES[:2]), (others, STATUSES[2:])):
        rows = [_row(log, linked=not artifacts) for log in logs if log.status in statuses]
        if not rows:
            continue
        table, left_out = _table(("log", "gate", "verdict", "why"), rows, room)
        room -= _size(table)
        # Logs that are well are many and seldom read.
        folded = statuses == STATUSES[2:] and len(rows) > 20
        shown = f"<details><summary>{len(rows)} logs</summary>\n\n{table}\n</details>\n"
        parts.append(f"### {title}\n\n{shown if folded else table}")
        parts += [_left_out(left_out, "log")] * bool(left_out)
    return "\n".join(parts)


def _head(result: GateResult) -> str:
    counted = {status: sum(log.status == status for log in result.single) for status in STATUSES}
    how_many = ", ".join(
        f"{counted[status]} {_WORDS[status]}" for status in STATUSES if counted[status]
    )
    ended = {0: "passed", 1: "failed"}.get(result.exit_code, "could not read every log")
    total = len(result.single)
    logs = "1 log" if total == 1 else f"{total} logs"
    return (
        f"## Gate: {ended}\n\n{_cell(result.question)}\n\n"
        f"Of {logs}: {how_many or 'nothing to tell'}. Recipe: {_cell(result.recipe)}\n"
    )


def _by_check(found: Sequence[Failure], result: GateResult) -> list[tuple[str, ...]]:
    return [
        (
            f"{_cell(group[0].outcome.check)}<br>{_cell(group[0].outcome.title)}",
            group[0].severity,
            f"{logs_of(group)} of {len(result.single)}" if logs_of(group) else "all together",
            _quoted((failure.outcome.message for failure in group), len(group), 1),
        )
        for group in grouped(found)
    ]


def _row(log: GatedLog, *, linked: bool) -> tuple[str, ...]:
    name = _cell(log.log)
    if log.report is not None and linked:
        name = f"[{name}]({quote(clean(log.report).strip('/'))}/report.html)"
    state = STATES[log.state].name if log.state in STATES else log.state or ""
    return name, _WORDS[log.status], _cell(state), _why(log)


def _why(log: GatedLog) -> str:
    """What failed; where nothing did what could not be assessed, after the verdict's summary."""
    failed = [x for x in log.outcomes if x.status in ("error", "failed")]
    if failed:
        return _quoted(map(told, failed), len(failed), _QUOTED)
    skipped = [f"not assessable: {told(x)}" for x in log.outcomes if x.status == "skipped"]
    return _quoted((log.summary, *skipped), 1 + len(skipped), _QUOTED)


def _quoted(texts: Iterable[str], count: int, most: int) -> str:
    lines = [_cell(text) for _, text in zip(range(most), texts, strict=False)]
    if count > most:
        lines.append(f"and {count - most} more")
    return "<br>".join(lines)


def _table(
    head: Sequence[str], rows: Sequence[Sequence[str]], room: int
) -> tuple[str, Sequence[Sequence[str]]]:
    """The table, and the rows that would make it larger than `room` bytes."""
    lines = [_line(head), _line(["---"] * len(head))]
    size = sum(_size(line) for line in lines)
    for number, row in enumerate(rows):
        line = _line(row)
        size += _size(line)
        if size > room:
            return "".join(lines), rows[number:]
        lines.append(line)
    return "".join(lines), ()


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |\n"


def _left_out(rows: Sequence[object], what: str) -> str:
    count = len(rows)
    more = f"1 more {what} is" if count == 1 else f"{count} more {what}s are"
    return f"{more} left out here, for GitHub shows 1 MiB; junit.xml has them all.\n"


def _size(text: str) -> int:
    return len(text.encode())


def _cell(text: str) -> str:
    """A text of a log as it is: no markup, no cell of its own, no link made of an address."""
    shown = as_markdown(one_line(text, _LETTERS))
    return shown.replace("://", "\\://").replace("www.", "www\\.")
