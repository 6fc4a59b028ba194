"""Intervals of shares and rates that are honest about few logs, and about logs that are alike.

Logs of one robot are no independent draws: a badly mounted laser fails all of them. Shares count
for as many independent logs as they are worth by the intraclass correlation of robots, rates are
widened by the dispersion between robots. Both are taken from the whole fleet, for a single group
hardly tells them.
"""

from __future__ import annotations

from functools import cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from slamreplay.consistency.statistics.shares import Z, wilson
from slamreplay.geometry import se2

#: Of all intervals.
_LEVEL = 0.95


@cache
def z_of(many: int) -> float:
    """Quantile of the normal distribution for `many` intervals that hold together with 95 %.

    Each is missed with an equal part of the 5 % (Bonferroni; Dunn 1961).
    """
    return NormalDist().inv_cdf(1.0 - (1.0 - _LEVEL) / (2.0 * many))


def newcombe(
    was: tuple[float, float], now: tuple[float, float], z: float = Z
) -> tuple[float, float]:
    """Interval of the difference `now` - `was` of two shares, each given with its `n`.

    Method 10 of Newcombe 1998, Statistics in Medicine 17, 873: square-and-add of both Wilson
    intervals.

    Args:
        was: share and number.
        now: likewise.
        z: quantile of the normal distribution, 95 % by default.
    """
    (p, n), (q, m) = was, now
    (p_low, p_high), (q_low, q_high) = wilson(p, n, z), wilson(q, m, z)
    down, up = np.hypot(q - q_low, p_high - p), np.hypot(q_high - q, p - p_low)
    return float(q - p - down), float(q - p + up)


def garwood(events: float, exposure: float) -> tuple[float, float]:
    """Exact interval of a Poisson rate (Garwood 1936), by quantiles of the gamma distribution.

    Args:
        events: counted; over-dispersed counts are divided by their dispersion, and so is
            `exposure`.
        exposure: greater than zero.
    """
    from scipy.special import gammaincinv

    tail = (1.0 - _LEVEL) / 2.0
    low = gammaincinv(events, tail) if events > 0 else 0.0
    return float(low) / exposure, float(gammaincinv(events + 1.0, 1.0 - tail)) / exposure


def intraclass_correlation(yes: NDArray[np.bool_], cluster: NDArray[np.int64]) -> float:
    """How much alike logs of one robot are, from 0 to 1, by analysis of variance.

    (B - W) / (B + (m - 1) W) of the mean squares between and within, m the adjusted mean size of
    unequal clusters (Donner 1986; of binary outcomes Ridout et al. 1999). 0 where it cannot be
    told: of fewer than two robots, or where none has two logs.

    Args:
        yes: (N,) outcome of each log.
        cluster: (N,) whose log it is.
    """
    _, index, size = np.unique(cluster, return_inverse=True, return_counts=True)
    n, k = len(yes), len(size)
    if k < 2 or n <= k:
        return 0.0
    share = np.bincount(index, weights=yes, minlength=k) / size
    between = float((size * (share - yes.mean()) ** 2).sum()) / (k - 1)
    within = float((size * share * (1.0 - share)).sum()) / (n - k)
    typical = (n - float((size.astype(float) ** 2).sum()) / n) / (k - 1)
    total = between + (typical - 1.0) * within
    return min(1.0, max(0.0, (between - within) / total)) if total > 0 else 0.0


def effective(cluster: NDArray[np.int64], correlation: float) -> float:
    """How many independent logs the logs of these clusters (N,) are worth.

    By the design effect of Kish 1965, 1 + correlation (m - 1), with m the size of the cluster that
    a log is in, on average: sum of squared sizes over N.
    """
    sizes = np.unique(cluster, return_counts=True)[1].astype(float)
    n = len(cluster)
    return n / (1.0 + correlation * (float((sizes**2).sum()) / n - 1.0)) if n else 0.0


def effective_pair(
    was: NDArray[np.int64], now: NDArray[np.int64], correlation: float
) -> tuple[float, float]:
    """How many independent logs two sets of logs are worth where they are compared.

    What is peculiar to a robot cancels as far as it has the same part in both: the variance of the
    difference of two means under a random effect of each robot is (1 - c) / n + (1 - c) / m + c S,
    with S the sum over robots of the squared difference of their parts. S is shared out by the sums
    of squared parts, so that sets without a robot in common count as in `effective`; none counts
    for more than it has logs.

    Args:
        was: (N,) robots of one set, N > 0.
        now: (M,) of the other, M > 0.
        correlation: of the outcome that is compared.
    """
    robots, index = np.unique(np.append(was, now), return_inverse=True)
    parts = [
        np.bincount(rows, minlength=len(robots)) / len(rows) for rows in np.split(index, [len(was)])
    ]
    squares = [float((part**2).sum()) for part in parts]
    apart = float(((parts[0] - parts[1]) ** 2).sum()) / sum(squares)
    one, other = (
        1.0 / max(1.0 / n, (1.0 - correlation) / n + correlation * square * apart)
        for n, square in zip((len(was), len(now)), squares, strict=True)
    )
    return one, other


def dispersion(events: se2.Array, expected: se2.Array, parameters: int) -> float:
    """Variance of counts (K,) over that of Poisson's, at least 1: Pearson's chi2 per freedom.

    The usual estimate of quasi-Poisson models (McCullagh and Nelder 1989, chapter 6).

    Args:
        events: (K,) counted.
        expected: (K,) by the common rate.
        parameters: how many were fitted.
    """
    there = expected > 0
    freedom = int(there.sum()) - parameters
    if freedom < 1:
        return 1.0
    off = events[there] - expected[there]
    return max(1.0, float((off**2 / expected[there]).sum()) / freedom)
