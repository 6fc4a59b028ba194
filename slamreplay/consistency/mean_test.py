"""Is the mean of squared whitened errors what a consistent belief would show?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtr, chdtrc

from slamreplay.consistency.effective_samples import effective_samples
from slamreplay.consistency.intervals import mean_interval

#: The nominal error probability of every interval that is printed.
NOMINAL = 0.05
#: Fewer effective samples than this decide nothing.
N_EFF_MIN = 20.0


@dataclass(frozen=True)
class MeanTest:
    """The mean of squared whitened errors against its interval.

    Attributes:
        dof: of each row: what the mean of a consistent belief would be.
        n: valid rows.
        n_eff: independent ones among them.
        mean: of the squared lengths; None without a valid row.
        low: lower end of the interval that a consistent belief's mean misses with `NOMINAL`.
        high: upper end.
        p_value: two-sided.
        p_small: one-sided, that the claimed covariance is too small.
        sufficient: whether there are `N_EFF_MIN` effective samples.
    """

    dof: int
    n: int
    n_eff: float
    mean: float | None
    low: float | None
    high: float | None
    p_value: float | None
    p_small: float | None
    sufficient: bool

    @property
    def ratio(self) -> float | None:
        """K = sqrt(mean / dof): sigma is too small by this factor, too large below 1."""
        return None if self.mean is None else math.sqrt(self.mean / self.dof)


def mean_test(white: ArrayLike) -> MeanTest:
    """Test errors (N, m) that were whitened, in time order; rows that are not finite are left out.

    They may hang together in time, as those of one log do; n_eff counts that.
    """
    w = np.asarray(white, dtype=np.float64)
    w = w[np.isfinite(w).all(axis=1)]
    n, dof = w.shape
    if not n:
        return MeanTest(dof, 0, 0.0, None, None, None, None, None, sufficient=False)
    squared = np.sum(w**2, axis=1)
    mean, n_eff = float(squared.mean()), effective_samples(squared)
    low, high = mean_interval(dof, n_eff, NOMINAL)
    below, above = (float(f(dof * n_eff, n_eff * mean)) for f in (chdtr, chdtrc))
    two_sided = min(1.0, 2.0 * min(below, above))
    return MeanTest(dof, n, n_eff, mean, low, high, two_sided, above, n_eff >= N_EFF_MIN)
