"""What a gate says of each log, one outcome per check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from slamreplay.bundle.findings import Severity

#: `skipped`: the log does not let this be assessed; `error`: the log could not be read at all.
Status = Literal["passed", "failed", "skipped", "error"]

#: The worst first.
STATUSES: tuple[Status, ...] = ("error", "failed", "skipped", "passed")


@dataclass(frozen=True)
class Outcome:
    """One check on one log.

    Attributes:
        check: its id, the same in every log and run: `expect/SR-LOC-001`, `forbid/SR-MAP-001`,
            `severity`, `limit/error_max_m`, `baseline/error_mean_m`, `assessable`, `read`.
        title: what it demands, in a few words.
        status: how it ended.
        severity: how bad a failure is.
        message: what was found, in one sentence; why, of a skipped one.
        start_ns: where in the log; None where it is about all of it.
        end_ns: the same.
        value: the number that was held against the limit, None without one.
        limit: what it was held against.
        unit: of both.
    """

    check: str
    title: str
    status: Status
    severity: Severity
    message: str
    start_ns: int | None = None
    end_ns: int | None = None
    value: float | None = None
    limit: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class GatedLog:
    """One log and what the gate says of it.

    Attributes:
        log: its path as the command line has it, with forward slashes: what CI shows and links to.
        state: of the verdict; None where it could not be read, and of all logs together, which
            stand under the path of the baseline.
        summary: of the verdict, or the line that says why it could not be read.
        start_ns: of the log; None likewise.
        outcomes: in the order of the rules.
        report: folder of its report beside the gate's files; None where none was written.
    """

    log: str
    state: str | None
    summary: str
    start_ns: int | None
    outcomes: tuple[Outcome, ...]
    report: str | None = None

    @property
    def status(self) -> Status:
        """The worst of its outcomes that counts: a log with skipped and passed ones passed."""
        found = {outcome.status for outcome in self.outcomes}
        for status in ("error", "failed"):
            if status in found:
                return status
        return "passed" if "passed" in found else "skipped"

    @property
    def is_of_all(self) -> bool:
        """Whether it stands for all logs together, and is none itself."""
        return self.state is None and self.status != "error"


@dataclass(frozen=True)
class GateResult:
    """What a gate says of all logs.

    Attributes:
        question: of the recipe.
        recipe: its path as the command line has it.
        logs: in the order of the command line.
    """

    question: str
    recipe: str
    logs: tuple[GatedLog, ...]

    @property
    def single(self) -> tuple[GatedLog, ...]:
        """The logs, without what stands for all of them together."""
        return tuple(log for log in self.logs if not log.is_of_all)

    @property
    def exit_code(self) -> int:
        """2 where a log could not be read, else 1 where a check failed, else 0."""
        found = {log.status for log in self.logs}
        return 2 if "error" in found else 1 if "failed" in found else 0
