"""The findings as the page lists them: the gravest first, numbers in words."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.bundle.findings import FINDINGS, SEVERITIES, Explanation
from slamreplay.evidence.result import Postmortem
from slamreplay.report.assess import title_of
from slamreplay.report.phrases import short, span


@dataclass(frozen=True)
class FindingRow:
    """A finding with its explanation."""

    id: str
    severity: str
    title: str
    message: str
    when: str
    numbers: str
    explanation: Explanation | None


def finding_rows(post: Postmortem) -> tuple[FindingRow, ...]:
    """One row for each finding."""
    return tuple(
        FindingRow(
            f.id,
            f.severity,
            title_of(f.id),
            f.message,
            span(post, f.start_ns, f.end_ns),
            _numbers(f.value, f.low, f.high, f.unit, f.n, f.n_eff),
            FINDINGS.get(f.id),
        )
        for f in sorted(post.findings, key=lambda f: -SEVERITIES.index(f.severity))
    )


def _numbers(
    value: float | None,
    low: float | None,
    high: float | None,
    unit: str,
    n: int | None,
    n_eff: float | None,
) -> str:
    parts = []
    if value is not None:
        parts.append(f"value {short(value)} {'' if unit == '1' else unit}".rstrip())
    if low is not None or high is not None:
        parts.append(f"expected {short(low)} to {short(high)}")
    if n is not None:
        effective = "" if n_eff is None else f", worth {n_eff:.0f} independent ones"
        parts.append(f"{n} samples{effective}")
    return "; ".join(parts)
