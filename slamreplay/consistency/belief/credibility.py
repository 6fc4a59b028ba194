"""SR-CON-001: does the published covariance match the error?"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.answers import P_ACCUSE, Answer, Suspicion, about_mean
from slamreplay.consistency.belief.amcl_limits import amcl_limits
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.nees import Nees, nees
from slamreplay.consistency.evidence.nees_summary import NeesSummary
from slamreplay.consistency.evidence.parts import Part
from slamreplay.consistency.evidence.source import Evidence
from slamreplay.consistency.evidence.summaries import summaries_of
from slamreplay.geometry.se2 import Array

#: Off by this factor the covariance misleads whoever plans with it: an error, not a warning.
GROSS = 2.0

_Told = tuple[Evidence, Part, NeesSummary]


def nees_of_belief(context: CheckContext) -> Nees | None:
    """NEES of the belief at its own updates against the best reference; None without either."""
    if context.updates is None or context.reference is None:
        return None
    return nees(context.updates, context.reference.track, left_out=context.left_out)


def check(context: CheckContext) -> tuple[Answer, ...]:
    """SR-CON-001 where the covariance is at fault, SR-CON-003 where that cannot be decided.

    Every source that can tell is asked. What shares evidence with the belief is asked only where no
    source could tell that the covariance is right, and only whether it is grossly too small.
    """
    updates = context.updates
    if updates is None:
        # That there is no belief is said by the verdict.
        return () if context.belief is None else (_unasked("no covariance was published"),)
    if not context.evidence:
        return (_unasked("no reference"),)
    if context.belonging is not None and context.belonging.refusal is not None:
        return (_undecided(f"NEES refused: {context.belonging.refusal}"),)
    limits = amcl_limits(context)
    limits = f"; {limits}" if limits else ""
    refused = [e for e in context.evidence if e.refusal]
    answers: list[Answer] = [
        _undecided(f"the covariance was not held against {e.source}: {e.refusal}") for e in refused
    ]
    summaries = [
        (e, part, summary)
        for e in context.evidence
        if e not in refused
        for part, summary in summaries_of(e, updates)
    ]
    enough = [told for told in summaries if told[2].credibility != "insufficient"]
    if any(e.is_exact for e, _, _ in enough):
        enough = [told for told in enough if not told[0].shared]
    elif enough:
        suspicions = [_suspicion(told, limits) for told in enough]
        if all(s.p_value >= P_ACCUSE for s in suspicions):
            answers.append(_unproven(enough, limits))
    elif summaries:
        answers.append(_too_few(summaries, limits))
    return (*answers, *(_suspicion(told, limits) for told in enough))


def _suspicion(told: _Told, limits: str) -> Suspicion:
    evidence, part, summary = told
    test = summary.test
    is_gross = (test.ratio or 0.0) >= GROSS
    severity: Severity = "error" if is_gross else "warning"
    note = f" ({evidence.note})" if evidence.note else ""
    effect = _effect(evidence, part, summary)
    text = f"{summary.sentence}, against {evidence.source}{note}{effect}{limits}"
    finding = about_mean("SR-CON-001", severity, text, evidence.t_ns, test)
    p = test.p_small if evidence.at_most else test.p_value
    if evidence.shared and not is_gross:
        p = None  # the scans that both are made of may be what is wrong
    return Suspicion(finding, 1.0 if p is None else p)


def _effect(evidence: Evidence, part: Part, summary: NeesSummary) -> str:
    """What sigma was claimed for which error, and what such a sigma does."""
    rows = np.isfinite(part.white(evidence)).all(axis=1)
    claimed, real = [], []
    for unit, scale in (("m", 1.0), ("rad", 180.0 / np.pi)):
        axes = [i for i in part.axes if evidence.axes[i].endswith(f" {unit}")]
        if axes:
            variance = np.diagonal(evidence.cov[rows], axis1=1, axis2=2)[:, axes].mean(axis=1)
            name = unit.replace("rad", "deg")
            claimed.append(f"{scale * np.sqrt(np.median(variance)):.2g} {name}")
            real.append(f"{scale * _rms(evidence.error[rows][:, axes]):.2g} {name}")
    does = "actions pass that there is no room for"
    if (summary.test.ratio or 0.0) < 1.0:
        does = "gates stay open for wrong matches, recoveries and slow driving are needless"
    own = ", the source's own included" if evidence.at_most else ""
    told = f"sigma {' and '.join(claimed)} (median{own}) for an error of {' and '.join(real)} (rms)"
    return f"; {told}: {does}"


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def _unproven(enough: list[_Told], limits: str) -> Finding:
    """What was looked at and showed nothing, although it could not have shown consistency."""
    gross = "gross " if all(e.shared for e, _, _ in enough) else ""
    parts = []
    for source in dict.fromkeys(e for e, _, _ in enough):
        why = "; ".join(text for text in (source.at_most, source.note) if text)
        said = "; ".join(s.sentence for e, _, s in enough if e is source)
        parts.append(f"against {source.source} ({why}) {said}")
    text = f"no {gross}over-confidence was found, which cannot prove consistency: "
    return _undecided(f"{text}{'. '.join(parts)}{limits}", enough[0])


def _too_few(summaries: list[_Told], limits: str) -> Finding:
    most = min(summaries, key=lambda told: _oddness(told[2]))
    evidence, _, summary = most
    text = f"too few independent updates ({summary.test.n_eff:.0f}) to judge the covariance against"
    return _undecided(f"{text} {evidence.source}: {summary.sentence}{limits}", most)


def _oddness(summary: NeesSummary) -> float:
    """The p-value, 2 where there is none: of what cannot be decided the oddest is worth a look."""
    return 2.0 if summary.test.p_value is None else summary.test.p_value


def _unasked(lacks: str) -> Finding:
    return _undecided(f"the covariance could not be held against an error: {lacks}")


def _undecided(text: str, told: _Told | None = None) -> Finding:
    if told is None:
        return Finding("SR-CON-003", "info", text)
    evidence, _, summary = told
    rows = len(evidence.t_ns) > 0
    return Finding(
        "SR-CON-003",
        "info",
        text,
        start_ns=int(evidence.t_ns[0]) if rows else None,
        end_ns=int(evidence.t_ns[-1]) if rows else None,
        n=summary.test.n,
        n_eff=summary.test.n_eff,
    )
