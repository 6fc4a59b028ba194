"""Are squared whitened errors distributed as the claimed covariance says?

Of Gaussian errors with the claimed covariance, e' P^-1 e is chi-square, so that
u = F(e' P^-1 e) is uniform: the probability integral transform (PIT). A mean test alone passes a
filter with the right mean and the wrong shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtr, kolmogi, kolmogorov

from slamreplay.consistency.statistics.error_samples import (
    NODES,
    WEIGHTS,
    ErrorSamples,
    error_samples,
)
from slamreplay.consistency.statistics.mean_test import N_EFF_MIN, NOMINAL
from slamreplay.geometry.se2 import Array

#: Shares of the errors that ellipses of these probabilities ought to hold.
LEVELS = (0.5, 0.68, 0.9, 0.95, 0.99)
#: Beyond this quantile an error is wild.
WILD = 0.99


@dataclass(frozen=True, eq=False)
class Distribution:
    """Squared whitened errors against the chi-square distribution.

    Attributes:
        dof: of each row.
        n: valid rows.
        n_eff: independent ones among them to the Kolmogorov-Smirnov test (`ks_samples`).
        pit: (n,) u in [0, 1], ascending; uniform where the covariance is right.
        coverage: the share of rows within the ellipse of each of `LEVELS`.
        distance: D, the largest distance between the two distribution functions.
        most: what D of consistent errors exceeds with `NOMINAL` only.
        p_value: of D.
        p_shape: of D after the errors were divided by their own scale: whether the shape is off,
            whatever the scale. Too large, if anything, for the scale was estimated (Lilliefors
            1967, On the Kolmogorov-Smirnov test for normality, JASA 62, 399-402).
        dispersion: variance of the squared errors after that division, over that of chi-square:
            above 1 a few errors are wild, below 1 they are too much alike.
        wild: the share of rows beyond the `WILD` quantile after that division.
        sufficient: whether there may be `N_EFF_MIN` effective samples.
    """

    dof: int
    n: int
    n_eff: float
    pit: Array
    coverage: tuple[float, ...]
    distance: float
    most: float
    p_value: float
    p_shape: float
    dispersion: float
    wild: float
    sufficient: bool


def distribution(white: ArrayLike) -> Distribution | None:
    """Judge errors (N, m) that were whitened, in time order; None without a finite row.

    They may hang together in time, as those of one log do; n_eff counts that.
    """
    w = np.asarray(white, dtype=np.float64)
    w = w[np.isfinite(w).all(axis=1)]
    n, dof = w.shape
    if not n:
        return None
    squared = np.sum(w**2, axis=1)
    pit = np.sort(chdtr(dof, squared))
    scaled = squared * (dof / max(float(squared.mean()), np.finfo(np.float64).tiny))
    pit_scaled = np.sort(chdtr(dof, scaled))
    samples = error_samples(w)
    n_eff = ks_samples(samples)
    return Distribution(
        dof=dof,
        n=n,
        n_eff=n_eff,
        pit=pit,
        coverage=tuple(float(x) for x in np.searchsorted(pit, LEVELS, side="right") / n),
        distance=ks_distance(pit),
        most=float(kolmogi(NOMINAL) / _stephens(n_eff)),
        p_value=ks_p_value(ks_distance(pit), n_eff, samples.spread),
        p_shape=ks_p_value(ks_distance(pit_scaled), n_eff, samples.spread),
        dispersion=float(scaled.var()) / (2.0 * dof),
        wild=float((pit_scaled > WILD).mean()),
        sufficient=samples.n_eff_max >= N_EFF_MIN,
    )


def ks_distance(pit: ArrayLike) -> float:
    """Kolmogorov and Smirnov's D of ascending values (n,) against the uniform distribution.

    Ties, as rounded poses make them, count at the middle of their ranks; without any it is D.
    """
    u = np.asarray(pit, dtype=np.float64)
    n = len(u)
    return float(np.abs(_middle_ranks(u, u) / n - u).max()) + 0.5 / n


def ks_p_value(distance: float, n_eff: float, spread: float = 0.0) -> float:
    """P-value of D of `n_eff` independent samples.

    Kolmogorov's limit with (sqrt(n) + 0.12 + 0.11 / sqrt(n)) D in it, which is good from few
    samples on (Stephens 1974, EDF statistics for goodness of fit and some comparisons, JASA 69,
    730-737).

    Args:
        distance: D.
        n_eff: effective samples.
        spread: relative standard error of n_eff. The p-value is averaged over a log-normal one:
            where the number of samples is itself a guess, no D proves as much as it seems to.
    """
    n = n_eff * np.exp(spread * NODES)
    return float(WEIGHTS @ kolmogorov(_stephens(n) * distance))


def ks_samples(squares: ErrorSamples) -> float:
    """Samples that errors are worth to the Kolmogorov-Smirnov test.

    They are worth more to it than to the mean of their squares: whether an error lies within an
    ellipse is forgotten sooner than its square, and of slowly changing errors the empirical
    distribution function is smoother than the Brownian bridge that D's null distribution comes
    from, so that D is smaller. Up to twice as many make up for it. Measured on consistent AR(1)
    errors (1 and 3 degrees of freedom, rho 0 to 0.99, worth 20 to 200 samples, 1000 logs each), a
    test at 5 % then accuses 1.4 to 5.3 % of those that may have enough samples, and one at 0.1 % up
    to 0.6 %.
    """
    remembered = 1.0 - squares.n_eff / max(squares.n, 1)  # 1 - 1/tau
    return min(float(squares.n), squares.n_eff * (1.0 + remembered**2))


def _middle_ranks(ascending: Array, values: Array) -> Array:
    """Where values (M,) stand among ascending ones (N,): 0 to N, ties at the middle of theirs."""
    low = np.searchsorted(ascending, values, side="left")
    return np.asarray(0.5 * (low + np.searchsorted(ascending, values, side="right")))


def _stephens(n_eff: ArrayLike) -> Array:
    root = np.sqrt(np.asarray(n_eff, dtype=np.float64))
    return root + 0.12 + 0.11 / root
