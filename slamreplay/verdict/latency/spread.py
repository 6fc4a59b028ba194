"""Percentiles and shares of ages, with intervals that know how much one age tells of the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betaincinv

from slamreplay.consistency.statistics.effective_samples import effective_samples

#: Fewer effective samples than this tell no interval of a 95th percentile.
FEWEST = 20.0


@dataclass(frozen=True)
class Spread:
    """N numbers, NaN left out; None where there are none.

    Attributes:
        p50: median.
        p95: 95 of 100 are smaller.
        most: the largest.
        p95_low: end of the 95 % interval of p95; None with too few effective samples.
        p95_high: the other end.
        n: numbers.
        n_eff: independent ones they are worth, where p95 is asked for.
    """

    p50: float | None = None
    p95: float | None = None
    most: float | None = None
    p95_low: float | None = None
    p95_high: float | None = None
    n: int = 0
    n_eff: float = 0.0


def spread(values: ArrayLike) -> Spread:
    """Percentiles of numbers (N,) in time order.

    The interval of p95 lies between two order statistics, whatever the distribution (David and
    Nagaraja 2003, Order Statistics, section 7.1), at ranks that hold for the effective number of
    samples of "p95 and above, or not".
    """
    x = _finite(values)
    if not len(x):
        return Spread()
    p95 = float(np.percentile(x, 95.0))
    n_eff = effective_samples((x >= p95).astype(np.float64))
    low = high = None
    if n_eff >= FEWEST:
        lower, upper = share_interval(0.95, n_eff)
        low, high = (float(v) for v in np.quantile(x, [lower, upper]))
    return Spread(float(np.median(x)), p95, float(x.max()), low, high, len(x), n_eff)


def share_above(values: ArrayLike, limit: float) -> tuple[float, float, float] | None:
    """Share of numbers (N,) in time order above a limit, and its 95 % interval; None of none."""
    x = _finite(values)
    if not len(x):
        return None
    over = (x > limit).astype(np.float64)
    share = float(over.mean())
    n_eff = effective_samples(over) if 0.0 < share < 1.0 else effective_samples(x)
    return share, *share_interval(share, n_eff)


def share_interval(share: float, n_eff: float) -> tuple[float, float]:
    """95 % interval of a share seen in `n_eff` samples (Clopper and Pearson 1934).

    Biometrika 26, 404-413: beta quantiles, which also hold for numbers that are not whole.
    """
    hits = share * n_eff
    low = float(betaincinv(hits, n_eff - hits + 1.0, 0.025)) if hits > 0.0 else 0.0
    high = float(betaincinv(hits + 1.0, n_eff - hits, 0.975)) if hits < n_eff else 1.0
    return low, high


def _finite(values: ArrayLike) -> NDArray[np.float64]:
    x = np.asarray(values, dtype=np.float64)
    return x[np.isfinite(x)]
