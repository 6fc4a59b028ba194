"""SR-CON-001: does the published covariance match the error?"""

from __future__ import annotations

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.nees import P_ACCUSE, Nees, NeesSummary, Part, nees
from slamreplay.consistency.published import fresh_rows, published_belief

#: Off by this factor the covariance misleads whoever plans with it: an error, not a warning.
GROSS = 2.0


def nees_of_belief(context: CheckContext) -> Nees | None:
    """NEES of the belief at its own updates against the context's reference; None without either.

    The rows are those the localizer published with a covariance; where no pose topic has one, the
    rows of the belief at which its covariance changed.
    """
    belief = _updates(context)
    if belief is None or context.reference is None:
        return None
    return nees(belief, context.reference)


def judged_parts(result: Nees) -> tuple[Part, ...]:
    """The joint value where position and heading are coupled, else both on their own.

    AMCL publishes no coupling, so that its joint value is an approximation.
    """
    return ("joint",) if result.has_cross_terms else ("xy", "yaw")


def check(context: CheckContext) -> tuple[Finding, ...]:
    """SR-CON-001 where the covariance is at fault, SR-CON-003 where that cannot be decided."""
    if context.belief is None and _updates(context) is None:
        return ()  # that there is no belief is said by the verdict
    result = nees_of_belief(context)
    if result is None:
        lacks = "no reference" if context.reference is None else "no covariance was published"
        return (_undecided(f"the covariance could not be held against an error: {lacks}"),)
    if result.refusal is not None:
        return (_undecided(f"NEES refused: {result.refusal}", result),)
    parts = judged_parts(result)
    # Each part takes its share of the error probability, so that the log as a whole keeps it.
    summaries = [result.summary(part, P_ACCUSE / len(parts)) for part in parts]
    accused = [s for s in summaries if s.credibility in ("overconfident", "underconfident")]
    kind = context.reference_kind or "reference"
    if kind == "hindsight":
        accused = [
            s for s in accused if s.credibility == "overconfident" and (s.ratio or 0.0) >= GROSS
        ]
    if accused:
        return tuple(_accusation(result, s, kind) for s in accused)
    if all(s.credibility == "insufficient" for s in summaries):
        few = max(s.n_eff for s in summaries)
        text = f"too few independent updates ({few:.0f}) to judge the covariance against {kind}"
        return (_undecided(f"{text}: {summaries[0].sentence}", result, few),)
    if kind == "hindsight":
        text = (
            "no gross over-confidence against hindsight, which shares the robot's scans and "
            f"therefore cannot prove consistency: {summaries[0].sentence}"
        )
        return (_undecided(text, result, summaries[0].n_eff),)
    return ()


def _updates(context: CheckContext) -> PoseTrack | None:
    published = published_belief(context.view)
    if published is not None or context.belief is None:
        return published
    fresh = fresh_rows(context.belief)
    return fresh if len(fresh) else None


def _accusation(result: Nees, summary: NeesSummary, kind: str) -> Finding:
    k = summary.ratio or 0.0
    severity: Severity = "error" if k >= GROSS else "warning"
    skipped = ", ".join(f"{count} {reason}" for reason, count in result.invalid.items())
    note = f" (left out: {skipped})" if skipped else ""
    return Finding(
        "SR-CON-001",
        severity,
        f"{summary.sentence}, against {kind.replace('_', ' ')}{note}",
        start_ns=int(result.t_ns[0]),
        end_ns=int(result.t_ns[-1]),
        value=summary.mean,
        low=summary.low,
        high=summary.high,
        unit="1",
        n=summary.n,
        n_eff=summary.n_eff,
    )


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
