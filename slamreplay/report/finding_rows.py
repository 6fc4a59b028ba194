"""The findings as the page lists them: the gravest first, numbers in words, each with an anchor."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from slamreplay.bundle.findings import FINDINGS, SEVERITIES, Explanation, Finding, Severity
from slamreplay.evidence.result import Postmortem
from slamreplay.report.assess import title_of
from slamreplay.report.moments import moment_link
from slamreplay.report.phrases import p_value, short, span

#: So many findings of one severity stand on the page; report.json has them all.
MOST_FINDINGS = 60
_HEADINGS: dict[Severity, tuple[str, str]] = {
    "error": ("error", "errors"),
    "warning": ("warning", "warnings"),
    "info": ("note", "notes"),
}
_UNFIT = re.compile(r"[^A-Za-z0-9_.-]+")


@dataclass(frozen=True)
class FindingRow:
    """A finding with its explanation, the id of its place on the page, and its moment's link."""

    anchor: str
    id: str
    severity: str
    title: str
    message: str
    when: str
    link: str
    numbers: str
    explanation: Explanation | None


@dataclass(frozen=True)
class FindingGroup:
    """The findings of one severity, and how many more of them there are."""

    severity: Severity
    heading: str
    rows: tuple[FindingRow, ...]
    more: int


def finding_groups(post: Postmortem) -> tuple[FindingGroup, ...]:
    """The findings by severity, the gravest first; each anchor is given once."""
    taken: set[str] = set()
    groups = []
    for severity in reversed(SEVERITIES):
        found = [f for f in post.findings if f.severity == severity]
        if not found:
            continue
        rows = tuple(_row(post, f, _anchor(f.id, taken)) for f in found[:MOST_FINDINGS])
        heading = f"{len(found):,} {_HEADINGS[severity][len(found) > 1]}"
        groups.append(FindingGroup(severity, heading, rows, len(found) - len(rows)))
    return tuple(groups)


def anchors(groups: Iterable[FindingGroup]) -> dict[str, str]:
    """By id the anchor of the first finding that has it."""
    found: dict[str, str] = {}
    for group in groups:
        for row in group.rows:
            found.setdefault(row.id, row.anchor)
    return found


def _anchor(id_: str, taken: set[str]) -> str:
    """The id itself, or what of it can be an address; a number makes a second one another.

    Ids of other packages' checks may be any text, and must not take a section's name.
    """
    plain = _UNFIT.sub("-", id_).strip("-")
    base = plain if plain.startswith("SR-") else f"finding-{plain}"
    name, k = base, 2
    while name in taken:
        name, k = f"{base}-{k}", k + 1
    taken.add(name)
    return name


def _row(post: Postmortem, f: Finding, anchor: str) -> FindingRow:
    return FindingRow(
        anchor,
        f.id,
        f.severity,
        title_of(f.id),
        f.message,
        span(post, f.start_ns, f.end_ns),
        moment_link(post, f.start_ns),
        _numbers(f),
        FINDINGS.get(f.id),
    )


def _numbers(f: Finding) -> str:
    parts = []
    if f.value is not None:
        parts.append(f"value {short(f.value)} {'' if f.unit == '1' else f.unit}".rstrip())
    if f.low is not None or f.high is not None:
        parts.append(f"expected {short(f.low)} to {short(f.high)}")
    if f.n is not None:
        effective = "" if f.n_eff is None else f", worth {f.n_eff:.0f} independent ones"
        parts.append(f"{f.n} samples{effective}")
    if f.p_value is not None:
        adjusted = "" if f.p_adjusted is None else f" ({p_value(f.p_adjusted)} after Holm)"
        parts.append(f"p {p_value(f.p_value)}{adjusted}")
    return "; ".join(parts)
