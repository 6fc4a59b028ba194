"""What is known of a share or a median that was counted over a few logs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from scipy.special import bdtr, bdtri


def share_interval(hits: int, n: int) -> tuple[float, float]:
    """95 % interval of a share (Clopper and Pearson 1934, Biometrika 26, 404-413)."""
    low = 0.0 if hits == 0 else float(bdtri(hits - 1, n, 0.975))
    high = 1.0 if hits == n else float(bdtri(hits, n, 0.025))
    return low, high


def median_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median of N values and an interval that covers the true one in 95 % of cases or more.

    Between two order statistics, whatever the distribution (David and Nagaraja 2003, Order
    Statistics, section 7.1). With fewer than six values there is no such pair: the interval is
    endless. A value may be infinite: an event that did not come while it was looked for.
    """
    n, ordered = len(values), sorted(values)
    middle = ordered[(n - 1) // 2], ordered[n // 2]
    median = middle[0] if middle[0] == middle[1] else sum(middle) / 2.0
    below = [k for k in range(n // 2) if bdtr(k, n, 0.5) <= 0.025]
    if not below:
        return median, -math.inf, math.inf
    return median, ordered[below[-1]], ordered[n - 1 - below[-1]]
