"""SR-CON-007: do innovations follow each other?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.answers import Suspicion
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.innovations.innovation_sets import InnovationSet, innovation_sets
from slamreplay.geometry.se2 import Array

#: Fewer innovations than this are not asked, and correlations below the other change little.
LEAST, SLIGHT = 20, 0.1
_MOST_LAGS = 10


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Autocorrelations of m series at lags 1 to h, and how likely white noise shows them.

    Attributes:
        rho: (m, h) autocorrelations.
        error: (m, h) their standard errors in white noise, 1 / sqrt(N) where its size is even.
        p_value: of all of them together.
    """

    rho: Array
    error: Array
    p_value: float


def whiteness(white: ArrayLike) -> Whiteness:
    """Test m independent series (N, m), of N >= 5, at lags 1 to min(10, N / 5).

    As Ljung and Box (1978, Biometrika 65, 297-303), but each squared autocorrelation is divided by
    its own variance, sum (x_t x_t-k)^2 / (sum x_t^2)^2, instead of (N - k) / (N (N + 2)): the
    robust t_k of Dalla, Giraitis, Phillips (2022, Robust tests for white noise and
    cross-correlation, Econometric Theory 38). Their sum is chi-square of m h degrees of freedom.
    With a sigma that is three times too small in a fifth of the log the former calls half of 500
    white innovations correlated at 0.1 %, this one 0.2 %. Means are taken off: a constant bias is
    another question.
    """
    series = np.asarray(white, dtype=np.float64)
    n = len(series)
    x = series - series.mean(axis=0)
    power = np.maximum(np.sum(x**2, axis=0), np.finfo(float).tiny)
    products = [x[k:] * x[:-k] for k in range(1, min(_MOST_LAGS, n // 5) + 1)]
    covariance = np.stack([np.sum(p, axis=0) for p in products], axis=1)
    spread = np.stack([np.sqrt(np.sum(p**2, axis=0)) for p in products], axis=1)
    t = np.divide(covariance, spread, out=np.zeros_like(covariance), where=spread > 0.0)
    p_value = float(chdtrc(t.size, np.sum(t**2)))
    return Whiteness(covariance / power[:, None], spread / power[:, None], p_value)


def check(context: CheckContext) -> tuple[Suspicion, ...]:
    """SR-CON-007 by source, in order of time whatever the intervals are."""
    sets = innovation_sets(context.innovations)
    return tuple(_suspicion(seen) for seen in sets if seen.accepted.sum() >= LEAST)


def _suspicion(seen: InnovationSet) -> Suspicion:
    found = whiteness(seen.white[seen.accepted])
    axis, lag = np.unravel_index(int(np.argmax(np.abs(found.rho))), found.rho.shape)
    first, largest = float(found.rho[axis, 0]), float(found.rho[axis, lag])
    bound = 1.96 * float(found.error[axis, 0])
    name = f" ({seen.axes[axis]})" if len(seen.axes) > 1 else ""
    text = f"the innovations of {seen.source} hang together in time: correlation {first:.2f} from "
    text += f"one to the next{name}"
    if lag:
        text += f", {largest:.2f} over {lag + 1} of them"
    text += f", where 95 % of white ones stay within {bound:.2f}: {_meaning(largest)}"
    severity: Severity = "info" if abs(largest) < SLIGHT else "warning"
    finding = Finding(
        "SR-CON-007",
        severity,
        text,
        start_ns=int(seen.t_ns[0]),
        end_ns=int(seen.t_ns[-1]),
        value=first,
        low=-bound,
        high=bound,
        unit="1",
        n=int(seen.accepted.sum()),
    )
    return Suspicion(finding, found.p_value)


def _meaning(rho: float) -> str:
    if rho > 0.0:
        return (
            "errors that last (a bias that changes, motion that the model lacks, the same data "
            "used twice), or Q too small beside R"
        )
    return "the filter follows its measurements too closely: R too small beside Q"
