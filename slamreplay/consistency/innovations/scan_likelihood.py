"""SR-CON-009: are scans as likely as the particle filter that takes them in predicts?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.answers import Answer, Suspicion
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.innovations.whiteness import LEAST
from slamreplay.geometry.se2 import Array

#: The tail that is counted, and the share of scans in it from which on it is worth a warning.
TAIL, MANY = 0.05, 0.1
#: So many scans beyond the other tail show a model too vague for the test to notice much.
_VAGUE = 0.5


def check(context: CheckContext) -> tuple[Answer, ...]:
    """SR-CON-009 where an estimator gives `likelihood_quantile`; nothing of other beliefs.

    The quantiles of a filter that is right are even and independent, one step after the other
    (Diebold, Gunther, Tay 1998), so that the least likely twentieth is binomial.
    """
    quantile = context.diagnostics.get("likelihood_quantile")
    if quantile is None or context.belief is None:
        return ()
    told = np.flatnonzero(np.isfinite(quantile))
    q, t_ns = quantile[told], context.belief.t_ns[told]
    if not len(q):
        return ()
    if len(q) < LEAST:
        return (_undecided(f"{len(q)} scans are too few to judge how likely they are", len(q)),)
    answers: list[Answer] = [_suspicion(q, t_ns)]
    above = float(np.mean(q > 1.0 - TAIL))
    if above > _VAGUE:
        text = (
            f"{100.0 * above:.0f} % of scans are likelier than 95 % of those that the particle "
            "filter predicts: its laser model (sigma_hit, z_rand) or its motion noise (alpha) is "
            "so vague that scans of a lost robot may not surprise it"
        )
        answers.append(_undecided(text, len(q)))
    return tuple(answers)


def _suspicion(q: Array, t_ns: NDArray[np.int64]) -> Suspicion:
    n, low = len(q), np.flatnonzero(q < TAIL)
    share = len(low) / n
    severity: Severity = "warning" if share >= MANY else "info"
    finding = Finding(
        "SR-CON-009",
        severity,
        f"{100.0 * share:.3g} % of {n} scans are less likely than 95 % of those that the particle "
        "filter predicts, where 5 % would be by chance: its cloud is not where the robot is, its "
        "laser model is too sure, or the map has changed",
        start_ns=int(t_ns[low[0]]) if len(low) else None,
        end_ns=int(t_ns[low[-1]]) if len(low) else None,
        value=share,
        low=0.0,
        high=TAIL,
        unit="1",
        n=n,
    )
    return Suspicion(finding, float(bdtrc(len(low) - 1, n, TAIL)) if len(low) else 1.0)


def _undecided(text: str, n: int) -> Finding:
    return Finding("SR-CON-003", "info", text, n=n)
