"""Dose and response: how much of one perturbation it takes until a run breaks, and what broke."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

#: What became of a search: half of the seeds or more crossed; fewer did; none did, up to the last
#: level; half or more are beyond the limit undisturbed already; no seed has such a number.
Outcome = Literal["crossed", "partly", "never", "always", "not_applicable"]


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
class Paired:
    """A level against the baseline of the same seed.

    Attributes:
        mean: over the seeds, of with minus without.
        low: end of its 95 % confidence interval; None below two seeds.
        high: the other end.
        n: seeds that have both numbers.
    """

    mean: float
    low: float | None
    high: float | None
    n: int


@dataclass(frozen=True)
class Response:
    """What one level did, over the seeds.

    Attributes:
        level: in the perturbation's unit.
        values: by metric, one number per seed of the curve; None where a seed has no such number,
            or was not asked at this level: each goes its own way in a search.
        paired: by metric, the differences from the baseline; none at the baseline itself.
    """

    level: float
    values: Mapping[str, tuple[float | None, ...]]
    paired: Mapping[str, Paired]


@dataclass(frozen=True)
class Critical:
    """The level at which one metric crosses its limit.

    A level is what was tried: the least that was seen broken, never one between two.

    Attributes:
        metric: whose limit.
        outcome: what was found.
        level: least level at which half of the seeds or more had crossed, None where fewer did.
        low: end of the interval towards the baseline: over seeds the interval of the median with
            `confidence`, of a single seed the last level that held. Never tighter than the bracket
            the search ended with. None where `outcome` is not_applicable.
        high: the other end; None where it lies beyond the last level.
        crossed: seeds that crossed.
        seeds: seeds that were asked.
        confidence: with which the interval covers the median over seeds, as a share: 0.95 or more,
            and less where there are too few of them for that. None of a single seed, which has a
            bracket and no spread.
    """

    metric: str
    outcome: Outcome
    level: float | None
    low: float | None
    high: float | None
    crossed: int
    seeds: int
    confidence: float | None


@dataclass(frozen=True)
class DoseCurve:
    """One perturbation of one estimator.

    Attributes:
        estimator: name in the registry.
        perturbation: `NAME.VARIANT`.
        unit: of the levels.
        baseline: the level that changes nothing.
        by_factor: whether levels are spaced by factors, as an axis that shows them should be.
        judged_by: what its errors are measured against.
        seeds: of its values: one where nothing in its trials is drawn at random.
        is_random: whether anything is.
        responses: by growing distance from the baseline, the baseline itself first.
        critical: one per limit, in the design's order.
        broke_first: metric whose limit is crossed at the least level, None where none is; of
            several at one level the first in the design's order. What is beyond its limit
            undisturbed does not count.
        notes: what a reader of its numbers must know, as sentences.
        reason: why there is no curve; empty where there is one.
    """

    estimator: str
    perturbation: str
    unit: str
    baseline: float
    by_factor: bool
    judged_by: str
    seeds: tuple[int, ...]
    is_random: bool
    responses: tuple[Response, ...]
    critical: tuple[Critical, ...]
    broke_first: str | None
    notes: tuple[str, ...] = ()
    reason: str = ""

    @property
    def is_scale(self) -> bool:
        """Whether a level multiplies, over a decade or more: half and double are equally far."""
        if self.unit != "ratio" or self.baseline <= 0.0 or not self.responses:
            return False
        levels = [response.level for response in self.responses]
        return min(levels) > 0.0 and max(levels) >= 10.0 * min(levels)


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
        judged_by: what errors are measured against: a kind of reference, hindsight or baseline;
            of estimators that differ in it all of them, by ", ".
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
