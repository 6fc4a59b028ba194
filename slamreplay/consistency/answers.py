"""What a check answers: facts, and suspicions that must survive the number of questions asked.

A log is asked dozens of questions. At 5 % each, one in twenty sound logs would be accused by every
one of them, so a suspicion becomes a finding only where its p-value, corrected after Holm for all
that were asked of the log, is below `P_ACCUSE`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.geometry.se2 import Array

if TYPE_CHECKING:
    from slamreplay.consistency.statistics.mean_test import MeanTest

#: A suspicion is raised only below this, after Holm's correction over the questions of a log.
P_ACCUSE = 1e-3


@dataclass(frozen=True)
class Suspicion:
    """A hypothesis that was tested: sound data are accused of `finding` with `p_value`.

    Every test that was made is handed on, whatever came out of it: how many were asked decides what
    any one of them is worth. The finding's `low` and `high` are the nominal 95 % interval.
    """

    finding: Finding
    p_value: float


Answer = Finding | Suspicion


def about_mean(
    id_: str, severity: Severity, message: str, t_ns: NDArray[np.int64], test: MeanTest
) -> Finding:
    """A finding whose numbers are those of a mean and its interval, over times (N,), N > 0."""
    return Finding(
        id_,
        severity,
        message,
        start_ns=int(t_ns[0]),
        end_ns=int(t_ns[-1]),
        value=test.mean,
        low=test.low,
        high=test.high,
        unit="1",
        n=test.n,
        n_eff=test.n_eff,
    )


def holm(p_values: ArrayLike) -> Array:
    """(N,) p-values adjusted for N questions, by Holm's step-down procedure.

    The k-th smallest is multiplied by N - k + 1, and none may fall below a smaller one: the chance
    of any false accusation then stays below the level, however the questions hang together (Holm
    1979, A simple sequentially rejective multiple test procedure, Scand. J. Statist. 6, 65-70).
    """
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def raised(answers: Sequence[Answer]) -> tuple[Finding, ...]:
    """The facts, and those suspicions that survive Holm's correction, in the order of the answers.

    Both p-values are printed: the finding's message ends with them.
    """
    suspicions = [a for a in answers if isinstance(a, Suspicion)]
    adjusted = iter(holm([s.p_value for s in suspicions]).tolist())
    found: list[Finding] = []
    for answer in answers:
        if isinstance(answer, Finding):
            found.append(answer)
            continue
        p_adjusted = next(adjusted)
        if p_adjusted < P_ACCUSE:
            found.append(_with_p(answer, p_adjusted, len(suspicions)))
    return tuple(found)


def _with_p(suspicion: Suspicion, p_adjusted: float, asked: int) -> Finding:
    finding = suspicion.finding
    p = suspicion.p_value
    text = f"p = {p:.1g}, {p_adjusted:.1g} after Holm over {asked} tests of this log"
    message = f"{finding.message} ({text})"
    return replace(finding, message=message, p_value=p, p_adjusted=p_adjusted)
