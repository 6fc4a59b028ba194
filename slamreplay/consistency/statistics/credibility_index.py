"""By how many decibels is a covariance not credible, and to which side does it err?

The noncredibility index and the inclination indicator of Li and Zhao (Measuring Estimator's
Credibility: Noncredibility Index, Fusion 2006; with Jilkov, Estimator's Credibility and Its
Measures, IFAC World Congress 2002): with rho_i = eps_i / eps*_i, where eps_i = e' P^-1 e is the
error squared as the claimed covariance P weighs it and eps*_i as the actual mean square error
matrix does,

    NCI = 10/N sum |log10 rho_i|,   I2 = 10/N sum log10 rho_i.

The papers were not at hand: formulas and signs are those of two public implementations that name
them, CredibilityTests of libmix4sam and probnum-evaluation. Three decibels are a factor of 2 in the
variance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from slamreplay.consistency.statistics.error_samples import error_samples
from slamreplay.consistency.statistics.mean_test import N_EFF_MIN
from slamreplay.consistency.statistics.whitening import whitened
from slamreplay.geometry.se2 import Array


@dataclass(frozen=True, eq=False)
class CredibilityIndex:
    """How credible the covariance of some errors is.

    Attributes:
        n: rows with an error.
        n_eff: independent ones among them, by the axis that changes most slowly.
        nci: noncredibility index, dB; 0 of a credible covariance.
        inclination: I2, dB; above 0 the covariance is too small, below it is too large.
        actual: (m, m) actual mean square error matrix in units of the claimed covariance, that is
            of the whitened errors: P* = L A L' with P = L L'. The identity where P is right.
        p_value: that it is the identity.
        p_direction: that it is a multiple of the identity: off in its scale alone.
        sufficient: whether there may be `N_EFF_MIN` effective samples.
    """

    n: int
    n_eff: float
    nci: float
    inclination: float
    actual: Array
    p_value: float
    p_direction: float
    sufficient: bool

    @property
    def worst(self) -> tuple[float, float]:
        """By what factor sigma is too small in the best direction and in the worst."""
        low, high = np.sqrt(np.linalg.eigvalsh(self.actual)[[0, -1]])
        return float(low), float(high)


def credibility_index(white: ArrayLike) -> CredibilityIndex | None:
    """Judge errors (N, m) that were whitened by what is claimed for them, in time order.

    The actual mean square error matrix is their own second moment about zero, so that a bias
    counts as error. That takes the claims of all rows to be off by the same factors along the
    whitened axes; it cannot see errors that are too large at one time and too small at another
    (SR-CON-004 does). Estimated from few samples it is noisy, and the index is never quite zero.

    None with no more rows than axes, or where all errors lie in a plane. Rows without a finite
    error are left out, and so are those without any, whose ratio has no value.
    """
    w = np.asarray(white, dtype=np.float64)
    w = w[np.isfinite(w).all(axis=1) & (w != 0.0).any(axis=1)]
    n, m = w.shape
    actual = w.T @ w / max(n, 1)
    if n <= m or np.linalg.matrix_rank(actual, hermitian=True) < m:
        return None
    real = whitened(w, np.broadcast_to(actual, (n, m, m)))
    ratio = np.log10(np.sum(w**2, axis=1) / np.sum(real**2, axis=1))
    samples = min((error_samples(column[:, None]) for column in w.T), key=lambda s: s.n_eff)
    p_value, p_direction = _p_values(actual, samples.n_eff)
    return CredibilityIndex(
        n=n,
        n_eff=samples.n_eff,
        nci=10.0 * float(np.abs(ratio).mean()),
        inclination=10.0 * float(ratio.mean()),
        actual=actual,
        p_value=p_value,
        p_direction=p_direction,
        sufficient=samples.n_eff_max >= N_EFF_MIN,
    )


def _p_values(second_moment: Array, n: float) -> tuple[float, float]:
    """Likelihood ratio tests of n Gaussian samples about zero: their covariance is I; is c I.

    With Bartlett's corrections (Rencher and Christensen 2012, Methods of Multivariate Analysis,
    section 7.2: a specified covariance matrix, and Mauchly's test of sphericity).
    """
    m = len(second_moment)
    n = max(n, m + 1.0)  # fewer decide nothing, and the corrections would be negative
    trace, log_det = float(np.trace(second_moment)), float(np.linalg.slogdet(second_moment)[1])
    one = (n - (2 * m**2 + 3 * m - 1) / (6.0 * (m + 1))) * (trace - log_det - m)
    round_ = (n - (2 * m**2 + m + 2) / (6.0 * m)) * (m * np.log(trace / m) - log_det)
    free = m * (m + 1) / 2
    p_round = 1.0 if m == 1 else float(chdtrc(free - 1, max(float(round_), 0.0)))
    return float(chdtrc(free, max(one, 0.0))), p_round
