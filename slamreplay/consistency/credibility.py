"""SR-CON-001: does the published covariance match the error?"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.amcl_limits import amcl_limits
from slamreplay.consistency.answers import Answer, Suspicion
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence import Reference
from slamreplay.consistency.nees import PARTS, Nees, Part, nees
from slamreplay.consistency.nees_summary import NeesSummary

#: Off by this factor the covariance misleads whoever plans with it: an error, not a warning.
GROSS = 2.0


def nees_of_belief(context: CheckContext) -> Nees | None:
    """NEES of the belief at its own updates against the best reference; None without either."""
    if context.updates is None or context.reference is None:
        return None
    return nees(context.updates, context.reference.track, left_out=context.left_out)


def judged_parts(result: Nees) -> tuple[Part, ...]:
    """The joint value where position and heading are coupled, else both on their own.

    AMCL publishes no coupling, so that its joint value is an approximation.
    """
    return ("joint",) if result.has_cross_terms else ("xy", "yaw")


def check(context: CheckContext) -> tuple[Answer, ...]:
    """SR-CON-001 where the covariance is at fault, SR-CON-003 where that cannot be decided."""
    if context.belief is None and context.updates is None:
        return ()  # that there is no belief is said by the verdict
    result = nees_of_belief(context)
    if result is None or context.reference is None:
        lacks = "no reference" if context.reference is None else "no covariance was published"
        return (_undecided(f"the covariance could not be held against an error: {lacks}"),)
    if result.refusal is not None:
        return (_undecided(f"NEES refused: {result.refusal}", result),)
    if context.belonging is not None and context.belonging.refusal is not None:
        return (_undecided(f"NEES refused: {context.belonging.refusal}", result),)
    limits = amcl_limits(context)
    limits = f"; {limits}" if limits else ""
    parts = {part: result.summary(part) for part in judged_parts(result)}
    summaries = list(parts.values())
    reference = context.reference
    if all(s.credibility == "insufficient" for s in summaries):
        few = max(s.test.n_eff for s in summaries)
        text = f"too few independent updates ({few:.0f}) to judge the covariance against "
        text += f"{reference.kind}: {summaries[0].sentence}{limits}"
        return (_undecided(text, result, few),)
    answers: list[Answer] = [
        _suspicion(result, s, reference, f"{_effect(result, part, s)}{limits}")
        for part, s in parts.items()
        if s.credibility != "insufficient"
    ]
    accused = [s for s in summaries if s.credibility == "overconfident" and _gross(s)]
    if reference.shared and not accused:
        text = (
            "no gross over-confidence against hindsight, which shares the robot's scans and "
            f"therefore cannot prove consistency: {summaries[0].sentence}{limits}"
        )
        answers.append(_undecided(text, result, summaries[0].test.n_eff))
    return tuple(answers)


def _gross(summary: NeesSummary) -> bool:
    return (summary.test.ratio or 0.0) >= GROSS


def _effect(result: Nees, part: Part, summary: NeesSummary) -> str:
    """What sigma was claimed for which error, and what such a sigma does."""
    rows = np.isfinite(result.values(part))
    claimed, real = [], []
    for axes, scale, unit in (((0, 1), 1.0, "m"), ((2,), 180.0 / np.pi, "deg")):
        if not set(axes) <= set(PARTS[part]):
            continue
        variance = np.diagonal(result.cov[rows], axis1=1, axis2=2)[:, axes].mean(axis=1)
        claimed.append(f"{scale * np.sqrt(np.median(variance)):.2g} {unit}")
        real.append(f"{scale * np.sqrt(np.mean(result.error[rows][:, axes] ** 2)):.2g} {unit}")
    does = "actions pass that there is no room for"
    if (summary.test.ratio or 0.0) < 1.0:
        does = "gates stay open for wrong matches, recoveries and slow driving are needless"
    told = f"sigma {' and '.join(claimed)} (median) for an error of {' and '.join(real)} (rms)"
    return f"; {told}: {does}"


def _suspicion(result: Nees, summary: NeesSummary, reference: Reference, more: str) -> Suspicion:
    severity: Severity = "error" if _gross(summary) else "warning"
    skipped = ", ".join(f"{count} {reason}" for reason, count in result.invalid.items())
    note = f" (left out: {skipped})" if skipped else ""
    finding = Finding(
        "SR-CON-001",
        severity,
        f"{summary.sentence}, against {reference.kind.replace('_', ' ')}{note}{more}",
        start_ns=int(result.t_ns[0]),
        end_ns=int(result.t_ns[-1]),
        value=summary.test.mean,
        low=summary.test.low,
        high=summary.test.high,
        unit="1",
        n=summary.test.n,
        n_eff=summary.test.n_eff,
    )
    p = 1.0 if summary.test.p_value is None else summary.test.p_value
    # What shares evidence with the belief can only show that it is far too sure of itself.
    return Suspicion(finding, 1.0 if reference.shared and not _gross(summary) else p)


def _undecided(text: str, result: Nees | None = None, n_eff: float | None = None) -> Finding:
    has_rows = result is not None and len(result.t_ns)
    return Finding(
        "SR-CON-003",
        "info",
        text,
        start_ns=int(result.t_ns[0]) if result is not None and has_rows else None,
        end_ns=int(result.t_ns[-1]) if result is not None and has_rows else None,
        n=len(result.t_ns) if result is not None else None,
        n_eff=n_eff,
    )
