"""What each source says about a belief's covariance, number by number, for whoever shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from slamreplay.consistency.answers import Answer, Suspicion, holm
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.parts import SPATIAL_POSE, Part, judged_parts
from slamreplay.consistency.evidence.source import SPATIAL_AXES, Evidence
from slamreplay.consistency.statistics.credibility_index import CredibilityIndex, credibility_index
from slamreplay.consistency.statistics.distribution import Distribution, distribution
from slamreplay.consistency.statistics.mean_test import MeanTest, mean_test


@dataclass(frozen=True, eq=False)
class PartSummary:
    """One part of the errors against one source.

    Attributes:
        name: pose, position, heading, rotation.
        mean: the mean NEES against its interval.
        p_value: of the mean; one-sided, that sigma is too small, where the covariance that was
            claimed is only a bound.
        p_adjusted: the same after Holm's correction over all tests of the log; None where it was
            not among them, as of sources that accuse nobody.
        distribution: of the squared errors; None without a valid row.
        index: the noncredibility index; None where the errors have too few rows or directions.
    """

    name: str
    mean: MeanTest
    p_value: float | None
    p_adjusted: float | None
    distribution: Distribution | None
    index: CredibilityIndex | None


@dataclass(frozen=True, eq=False)
class ConsistencySummary:
    """A belief against one source; see `Evidence` for all but the parts."""

    source: str
    kind: str
    shared: bool
    at_most: str
    parts: tuple[PartSummary, ...]


def consistency_summaries(
    context: CheckContext, answers: Sequence[Answer]
) -> tuple[ConsistencySummary, ...]:
    """Every source with at least one error, the best first.

    Args:
        context: the belief and what it is held against.
        answers: all that the log was asked, for Holm's correction.
    """
    if context.updates is None:
        return ()
    asked = [a for a in answers if isinstance(a, Suspicion)]
    p_holm = holm([a.p_value for a in asked]).tolist()
    # By the mean as well: far out many p-values are 0.
    adjusted = {(a.finding.value, a.p_value): p for a, p in zip(asked, p_holm, strict=True)}
    summaries = []
    for evidence in context.evidence:
        parts = judged_parts(evidence, context.updates)
        parts = (*parts, SPATIAL_POSE) if evidence.axes == SPATIAL_AXES else parts
        told = tuple(_part(evidence, part, adjusted) for part in parts)
        if any(part.mean.n for part in told):
            summaries.append(
                ConsistencySummary(
                    evidence.source, evidence.kind, evidence.shared, evidence.at_most, told
                )
            )
    return tuple(summaries)


def _part(
    evidence: Evidence, part: Part, adjusted: dict[tuple[float | None, float], float]
) -> PartSummary:
    white = part.white(evidence)
    mean = mean_test(white)
    p_value = mean.p_small if evidence.at_most else mean.p_value
    p_adjusted = None if p_value is None else adjusted.get((mean.mean, p_value))
    return PartSummary(
        part.name, mean, p_value, p_adjusted, distribution(white), credibility_index(white)
    )
