"""What a gate demands of every log: what must be found, what must not, and how far numbers go."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from slamreplay.bundle.findings import Severity


@dataclass(frozen=True)
class Limit:
    """How far a number may go.

    Attributes:
        metric: its name, with the unit in it.
        maximum: it fails above this; None without one.
        minimum: it fails below this; None without one.
        clear: hysteresis, as of a Schmitt trigger: once it failed it holds again only when it is
            back on this side of `clear`. Of a number over time that is within the log, of a number
            per log it is from one run to the next, by the baseline. None: the limit itself.
        for_s: of a number over time, how long it must stay beyond the limit to fail, s.
    """

    metric: str
    maximum: float | None = None
    minimum: float | None = None
    clear: float | None = None
    for_s: float = 0.0


@dataclass(frozen=True)
class Rules:
    """The demands on one log.

    Attributes:
        expect: ids of findings and `state=NAME`, `failure_mode=NAME`, `root_cause=NAME` that must
            be there; of SR-LOC-* one of its kind.
        forbid: the same, that must not; of SR-LOC-* all of its kind but those that are expected.
        max_severity: the worst that a finding may have which nobody expects; None allows all.
        limits: on numbers.
        require_assessable: a log fails of which nothing of all this could be assessed.
    """

    expect: tuple[str, ...] = ()
    forbid: tuple[str, ...] = ()
    max_severity: Severity | None = "warning"
    limits: tuple[Limit, ...] = ()
    require_assessable: bool = True


@dataclass(frozen=True)
class BaselineRules:
    """When a difference from the committed baseline counts.

    Attributes:
        alpha: chance of any false alarm in a run of the gate, over all its tests (after Holm).
        margins: by number, the difference below which it does not matter, in the number's unit;
            those that are not named have the defaults of `gate.baseline_metrics`.
        gross: a mean over time that is worse by so many margins on the very same log fails even
            where its blocks are too few or too much alike to prove it: nothing was drawn at
            random, so that it is a fact of that log. 1 or more; None leaves all to the tests.
    """

    alpha: float = 0.001
    margins: Mapping[str, float] = field(default_factory=dict)
    gross: float | None = 10.0


@dataclass(frozen=True)
class Demands:
    """A whole recipe of a gate.

    Attributes:
        question: in one sentence.
        rules: for every log.
        of_logs: by glob pattern, rules that take their place for a log; the first pattern that
            fits counts. One without a slash is of the file's name, one with slashes of as many
            last parts of its path.
        estimators: run again on every log, so that their numbers can be limited, too, as
            `amcl.error_max_m`.
        seeds: how often each of them runs.
        baseline: when a difference from an earlier run counts.
    """

    question: str
    rules: Rules
    of_logs: Mapping[str, Rules] = field(default_factory=dict)
    estimators: tuple[str, ...] = ()
    seeds: int = 1
    baseline: BaselineRules = field(default_factory=BaselineRules)

    def rules_of(self, log: str) -> Rules:
        """Those for one log, by its path with forward slashes."""
        path = PurePosixPath(log)
        return next((r for glob, r in self.of_logs.items() if path.match(glob)), self.rules)
