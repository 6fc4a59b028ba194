"""SR-CON-010: where the covariance collapsed, each collapse told once."""

from __future__ import annotations

import math

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.answers import Answer, Suspicion
from slamreplay.consistency.belief.collapse.floor import below_floor
from slamreplay.consistency.belief.collapse.outgrown import outgrown
from slamreplay.consistency.belief.collapse.stretch import Stretch, merged
from slamreplay.consistency.belief.collapse.uninformed import uninformed
from slamreplay.consistency.belief.credibility import GROSS
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry.times import NS_PER_S


def check(context: CheckContext) -> tuple[Answer, ...]:
    """One answer for each collapse: a suspicion where only errors say so, else a fact.

    It is an error where sigma was too small by `GROSS` against independent evidence.
    """
    if context.updates is None:
        return ()  # that there is no covariance is said by SR-CON-002 and SR-CON-003
    grown, p_rest = outgrown(context.updates, context.evidence)
    stretches = merged([*grown, *uninformed(context), *below_floor(context)])
    answers = [_answer(s, context.view.manifest.start_ns) for s in stretches]
    if p_rest is not None:
        answers.append(Suspicion(Finding("SR-CON-010", "info", "sigma kept up"), p_rest))
    return tuple(answers)


def _answer(stretch: Stretch, log_start_ns: int) -> Answer:
    start, lasted = (
        t / NS_PER_S for t in (stretch.start_ns - log_start_ns, stretch.end_ns - stretch.start_ns)
    )
    severity: Severity = "warning"
    if stretch.independent and stretch.factor >= GROSS:
        severity = "error"
    finding = Finding(
        "SR-CON-010",
        severity,
        f"from {start:.1f} s for {lasted:.1f} s {'; '.join(stretch.reasons.values())}",
        start_ns=stretch.start_ns,
        end_ns=stretch.end_ns,
        value=stretch.factor if math.isfinite(stretch.factor) else None,
        high=1.0,
        unit="ratio",
        n=stretch.n,
    )
    return finding if stretch.p_value is None else Suspicion(finding, stretch.p_value)
