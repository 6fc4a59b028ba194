"""Where a share lies that was counted."""

from __future__ import annotations

import math

#: 97.5 % quantile of the normal distribution: two-sided intervals of 95 %.
Z = 1.959963984540054


def wilson(share: float, n: float, z: float = Z) -> tuple[float, float]:
    """Wilson's score interval (Wilson 1927) of a share of `n` independent ones; 0 to 1 of none.

    Args:
        share: from 0 to 1.
        n: need not be whole: it may be an effective number (Korn and Graubard 1998).
        z: quantile of the normal distribution, 95 % by default.
    """
    if n <= 0:
        return 0.0, 1.0
    middle = share + z * z / (2.0 * n)
    half = z * math.sqrt(share * (1.0 - share) / n + z * z / (4.0 * n * n))
    scale = 1.0 + z * z / n
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)
