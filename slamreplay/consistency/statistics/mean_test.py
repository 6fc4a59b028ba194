"""Is the mean of squared whitened errors what a consistent belief would show?

Under a consistent belief n_eff times the mean of n_eff independent chi-square values of `dof` is
chi-square of dof * n_eff (Bar-Shalom, Li, Kirubarajan 2001, section 5.4.2). How many the correlated
ones of a log are worth is itself an estimate, so that p-values are averaged over a log-normal n_eff
of the estimate's own spread. False alarms and power were measured: `recipes/interval-calibration`.
Where a gate has cut off the large ones, mean and variance are those of what it leaves, and the
chi-square of the same two moments stands for the distribution (Satterthwaite 1946, Biometrics
Bulletin 2, 110-114).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtr, chdtrc, chdtri

from slamreplay.consistency.statistics.error_samples import (
    NODES,
    WEIGHTS,
    ErrorSamples,
    error_samples,
)
from slamreplay.consistency.statistics.truncation import Truncation

#: The nominal error probability of every interval that is printed.
NOMINAL = 0.05
#: Where even the upper end of n_eff's interval is below this, nothing is decided.
N_EFF_MIN = 20


@dataclass(frozen=True)
class MeanTest:
    """The mean of squared whitened errors against its interval.

    Attributes:
        dof: of each row: what the mean of a consistent belief would be without a gate.
        samples: valid rows, and what they are worth.
        mean: of the squared lengths; None without a valid row.
        p_value: two-sided.
        p_small: one-sided, that the claimed covariance is too small.
        gate: what was cut off before.
    """

    dof: int
    samples: ErrorSamples
    mean: float | None
    p_value: float | None
    p_small: float | None
    gate: Truncation | None = None

    @property
    def n(self) -> int:
        """Valid rows."""
        return self.samples.n

    @property
    def n_eff(self) -> float:
        """Independent ones among them."""
        return self.samples.n_eff

    @property
    def sufficient(self) -> bool:
        """Whether there may be `N_EFF_MIN` effective samples."""
        return self.samples.n_eff_max >= N_EFF_MIN

    @property
    def low(self) -> float | None:
        """Lower end of the interval that a consistent belief's mean misses with `NOMINAL`."""
        return None if self.mean is None else self._ends[0]

    @property
    def high(self) -> float | None:
        """Upper end of it."""
        return None if self.mean is None else self._ends[1]

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Searched for when asked: most tests are asked for their p-value alone."""
        shape, unit = _matched(self.dof, self.gate)
        low, high = _interval(shape, self.samples)
        return unit * low, unit * high

    @property
    def ratio(self) -> float | None:
        """The factor sqrt(mean / dof): sigma is too small by this factor, too large below 1."""
        if self.mean is None:
            return None
        return (self.gate or Truncation(self.dof)).scale(self.mean, self.dof)

    @property
    def expected(self) -> float:
        """The mean of a consistent belief."""
        return (self.gate or Truncation(self.dof)).mean(self.dof)


def mean_test(white: ArrayLike, gate: Truncation | None = None) -> MeanTest:
    """Test errors (N, m) that were whitened, in time order; rows that are not finite are left out.

    They may hang together in time, as those of one log do; n_eff counts that.

    Args:
        white: the errors.
        gate: through which they came, where one was in the way; it may be of more dimensions.
    """
    w = np.asarray(white, dtype=np.float64)
    w = w[np.isfinite(w).all(axis=1)]
    n, dof = w.shape
    if not n:
        return MeanTest(dof, ErrorSamples(0, 0.0, 0.0), None, None, None, gate)
    mean, samples = float(np.sum(w**2) / n), error_samples(w)
    shape, unit = _matched(dof, gate)
    above, below = _tails(shape, samples, mean / unit)
    return MeanTest(dof, samples, mean, min(1.0, 2.0 * min(above, below)), above, gate)


def _matched(dof: int, gate: Truncation | None) -> tuple[float, float]:
    """Degrees of freedom of a chi-square, and the unit in which it has the moments of a row."""
    if gate is None or gate.is_none:
        return float(dof), 1.0
    mean, variance = gate.mean(dof), gate.variance(dof)
    return 2.0 * mean**2 / variance, variance / (2.0 * mean)


def _tails(dof: float, samples: ErrorSamples, mean: float) -> tuple[float, float]:
    """Probabilities of a mean at least, and at most, as large from a consistent belief."""
    worth = np.clip(samples.n_eff * np.exp(samples.spread * NODES), 1.0, samples.n)
    total = dof * worth
    above, below = chdtrc(total, worth * mean), chdtr(total, worth * mean)
    return float(WEIGHTS @ above), float(WEIGHTS @ below)


def _interval(dof: float, samples: ErrorSamples) -> tuple[float, float]:
    """Where each tail is half of `NOMINAL`."""
    from scipy.optimize import brentq  # takes half a second to load

    least = dof * max(1.0, samples.n_eff * math.exp(samples.spread * float(NODES[0])))
    outer = [chdtri(least, p) / (least / dof) for p in (1.0 - 1e-6, 1e-6)]
    low = brentq(lambda m: _tails(dof, samples, m)[1] - NOMINAL / 2.0, outer[0], dof, xtol=1e-10)
    high = brentq(lambda m: _tails(dof, samples, m)[0] - NOMINAL / 2.0, dof, outer[1], xtol=1e-10)
    return float(low), float(high)
