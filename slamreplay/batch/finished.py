"""What is told of a log that a watch has done: a line for people, JSON for programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from slamreplay.batch.task import LogResult


@dataclass(frozen=True)
class Finished:
    """A log whose rows and report are kept.

    Attributes:
        log: its path or address.
        key: of the log and how it was read.
        state: of its verdict; None of one that failed.
        summary: the verdict in one sentence, or why it failed.
        gate: passed, failed or skipped; None without a gate, and of one that failed.
        report: folder of its report, None of one that failed.
        has_failed: whether it could not be judged.
    """

    log: str
    key: str
    state: str | None
    summary: str
    gate: str | None
    report: Path | None
    has_failed: bool


def finished_of(target: Path, result: LogResult) -> Finished:
    """What is told of a result that was kept in a batch's folder."""
    (row,) = result.tables["logs"].to_pylist()
    return Finished(
        log=row["log"],
        key=result.key,
        state=row["state"],
        summary=row["summary"] if result.error is None else result.error,
        gate=row["gate"],
        report=None if row["report"] is None else target / row["report"],
        has_failed=result.error is not None,
    )
