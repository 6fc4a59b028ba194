"""Squared whitened errors of which a gate has cut off the large ones.

An m-dimensional standard normal vector w of which only |w|^2 <= c was let through keeps its
symmetry, so that of any k of its dimensions E|w_k|^2 = k a and E|w_k|^4 = k (k + 2) b with
a = F_{m+2}(c) / F_m(c), b = F_{m+4}(c) / F_m(c) and F_m the chi-square distribution of m degrees of
freedom: its density times x is m times that of m + 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import chdtr

#: Scales beyond this are not told apart: the errors fill the gate evenly.
SCALE_MAX = 10.0


@dataclass(frozen=True)
class Truncation:
    """What a gate leaves of `dof`-dimensional whitened errors.

    Attributes:
        dof: m, the dimension of what is gated.
        cut: largest squared length that is let through; infinity without a gate.
    """

    dof: int
    cut: float = math.inf

    @property
    def is_none(self) -> bool:
        """Whether nothing is cut off."""
        return math.isinf(self.cut)

    def mean(self, k: int) -> float:
        """Of the squared length of k of the dimensions of consistent errors: k without a gate."""
        return k * self._share(2)

    def variance(self, k: int) -> float:
        """Of the same: 2 k without a gate."""
        return k * (k + 2) * self._share(4) - self.mean(k) ** 2

    def scale(self, mean: float, k: int) -> float:
        """By what factor the errors are larger than claimed if this is their mean.

        `SCALE_MAX` where they fill the gate as evenly as errors of any larger scale would.
        """
        if self.is_none:
            return math.sqrt(mean / k)
        from scipy.optimize import brentq  # takes half a second to load

        def excess(scale: float) -> float:
            inner = Truncation(self.dof, self.cut / scale**2)
            return scale**2 * inner.mean(k) - mean

        if excess(SCALE_MAX) <= 0.0:
            return SCALE_MAX
        return float(brentq(excess, 1e-6, SCALE_MAX, xtol=1e-9)) if mean > 0.0 else 0.0

    def _share(self, more: int) -> float:
        if self.is_none:
            return 1.0
        return float(chdtr(self.dof + more, self.cut) / chdtr(self.dof, self.cut))
