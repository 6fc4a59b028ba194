"""Dose and response: how much of one perturbation it takes until a run breaks, and what broke."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

#: What became of a search: crossed; whole up to the last level; broken at the baseline already.
Outcome = Literal["crossed", "never", "always", "not_applicable"]


@dataclass(frozen=True)
class Limit:
    """A number of a run that counts as broken beyond a value.

    Attributes:
        metric: name of the number, unit in the name.
        at_most: the greatest value that is whole.
        title: the same in a few words: "error above 0.5 m".
    """

    metric: str
    at_most: float
    title: str


@dataclass(frozen=True)
class Response:
    """What one level did, over the seeds.

    Attributes:
        level: in the perturbation's unit.
        values: by metric, one number per seed; None where a seed has no such number.
        paired: by metric, mean over the seeds of this level minus the baseline of the same seed,
            and the ends of its 95 % confidence interval; ends are None with a single seed.
    """

    level: float
    values: Mapping[str, tuple[float | None, ...]]
    paired: Mapping[str, tuple[float, float | None, float | None]]


@dataclass(frozen=True)
class Critical:
    """The level at which one metric crosses its limit.

    Attributes:
        metric: whose limit.
        outcome: what was found.
        level: median over the seeds that crossed; None where it was not crossed.
        low: end of the 95 % interval over seeds, in the direction of the baseline; never tighter
            than the bracket the search ended with.
        high: the other end.
        crossed: seeds that crossed.
        seeds: seeds that were asked.
    """

    metric: str
    outcome: Outcome
    level: float | None
    low: float | None
    high: float | None
    crossed: int
    seeds: int


@dataclass(frozen=True)
class DoseCurve:
    """One perturbation of one estimator.

    Attributes:
        estimator: name in the registry.
        perturbation: `NAME.VARIANT`.
        unit: of the levels.
        baseline: the level that changes nothing.
        responses: by growing distance from the baseline, the baseline itself first.
        critical: one per limit, in the design's order.
        broke_first: metric whose limit is crossed at the least level, None where none is.
        reason: why there is no curve; empty where there is one.
    """

    estimator: str
    perturbation: str
    unit: str
    baseline: float
    responses: tuple[Response, ...]
    critical: tuple[Critical, ...]
    broke_first: str | None
    reason: str = ""


@dataclass(frozen=True)
class Control:
    """A trial whose answer is known beforehand, so that the design itself is tested.

    Attributes:
        kind: `no_op` goes through the perturbation at its baseline level and must give the
            baseline's bits; `positive` is known to break the run and must cross a limit.
        estimator: whose.
        perturbation: `NAME.VARIANT`.
        level: in `unit`.
        unit: of the level.
        passed: None where the trial was not applicable.
        text: what was seen, as one sentence.
    """

    kind: Literal["no_op", "positive"]
    estimator: str
    perturbation: str
    level: float
    unit: str
    passed: bool | None
    text: str


@dataclass(frozen=True)
class DoseResults:
    """The answer of a design.

    Attributes:
        question: one sentence.
        seeds: that were used.
        judged_by: what errors are measured against: a kind of reference, hindsight or the baseline.
        limits: what counts as broken; the first is the one that is searched for.
        curves: by perturbation, then estimator, in the design's order.
        controls: of every estimator.
    """

    question: str
    seeds: tuple[int, ...]
    judged_by: str
    limits: tuple[Limit, ...]
    curves: tuple[DoseCurve, ...]
    controls: tuple[Control, ...]
