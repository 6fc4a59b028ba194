"""What a gate found wrong, worst first, with names that stay the same from run to run."""

from __future__ import annotations

import posixpath
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256

from slamreplay.bundle.findings import SEVERITIES, Severity
from slamreplay.gate.outcome import GatedLog, GateResult, Outcome
from slamreplay.geometry.times import decimal_seconds


def told(outcome: Outcome) -> str:
    """What it demands and what was found, for a place that does not show the former."""
    return ": ".join(text for text in (outcome.title, outcome.message) if text) or outcome.check


def logs_of(failures: Iterable[Failure]) -> int:
    """How many logs they are on: what stands for all logs together is none."""
    return len({failure.log.log for failure in failures if not failure.log.is_of_all})


@dataclass(frozen=True)
class Failure:
    """A check that failed on a log, or a log that could not be read.

    Attributes:
        log: which.
        outcome: of the check; its status is failed or error.
        nth: counts outcomes of the same check on the same log, from 1.
    """

    log: GatedLog
    outcome: Outcome
    nth: int

    @property
    def severity(self) -> Severity:
        """How bad; a log that could not be read is an error."""
        return "error" if self.outcome.status == "error" else self.outcome.severity

    @property
    def fingerprint(self) -> str:
        """32 hex digits of log, check and `nth`.

        No number that was found is in it: CI follows one problem over commits while its numbers
        move.
        """
        named = "\0".join((self.outcome.check, relative(self.log.log), str(self.nth)))
        return sha256(named.encode("utf-8", "surrogatepass")).hexdigest()[:32]


def failures(result: GateResult) -> list[Failure]:
    """All of them: logs that could not be read first, then by severity, then as they came."""
    found: list[Failure] = []
    seen: Counter[tuple[str, str]] = Counter()
    for log in result.logs:
        for outcome in log.outcomes:
            if outcome.status in ("error", "failed"):
                named = outcome.check, relative(log.log)
                seen[named] += 1
                found.append(Failure(log, outcome, seen[named]))
    return sorted(found, key=lambda x: (x.outcome.status != "error", _rank(x.severity)))


def grouped(found: Iterable[Failure]) -> list[list[Failure]]:
    """Those of one check and severity together, the worst first, then those on most logs.

    Args:
        found: as of `failures`.
    """
    groups: dict[tuple[bool, Severity, str], list[Failure]] = {}
    for one in found:
        key = one.outcome.status != "error", one.severity, one.outcome.check
        groups.setdefault(key, []).append(one)
    ranked = sorted(groups.items(), key=lambda x: (x[0][0], _rank(x[0][1]), -len(x[1])))
    return [group for _, group in ranked]


def relative(path: str) -> str:
    """The path as CI wants it: no "./" before it; an absolute one without its first slash.

    A file outside the repository has no right name there; with the slash CI refuses the whole file.
    """
    return posixpath.normpath(path).lstrip("/") if path else path


def span_s(log: GatedLog, outcome: Outcome) -> tuple[str, ...]:
    """First and last moment in s since the log's start, three decimals; as far as known."""
    if log.start_ns is None:
        return ()
    times = (outcome.start_ns, outcome.end_ns)
    return tuple(decimal_seconds(t - log.start_ns)[:-6] for t in times if t is not None)


def _rank(severity: Severity) -> int:
    """The worst is the least."""
    return -SEVERITIES.index(severity)
