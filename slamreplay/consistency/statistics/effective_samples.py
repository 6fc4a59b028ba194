"""How many independent samples a correlated series is worth.

Samples of one log follow each other too closely to be independent: on a perfectly consistent but
correlated error the textbook interval of the mean cries wolf in most logs. All intervals here are
therefore drawn for the effective number of samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.geometry.se2 import Array


def lagged_sums(series: Array) -> Array:
    """Sums of products at lags 0 to N-1 of each column of (N, ...), as they are."""
    n = len(series)
    power = np.abs(np.fft.rfft(series, 2 * n, axis=0)) ** 2  # zero-padded, or the ends would meet
    return np.asarray(np.fft.irfft(power, 2 * n, axis=0)[:n])


def autocorrelation(series: ArrayLike) -> Array:
    """(N,) autocorrelation of a series (N,) at lags 0 to N-1, divided by N at every lag.

    The division by N, not N - lag, keeps the sequence positive definite. A constant series never
    says anything new: its autocorrelation is 1 at every lag.
    """
    x = np.asarray(series, dtype=np.float64)
    n = len(x)
    if not n:
        return np.empty(0)
    covariance = lagged_sums(x - x.mean())
    return np.asarray(covariance / covariance[0]) if covariance[0] > 0.0 else np.ones(n)


def autocorrelation_time(series: ArrayLike) -> tuple[float, float]:
    """Integrated autocorrelation time in samples, and its standard error, of a series (N,).

    tau = -1 + 2 sum_k G_k with G_k = rho_2k + rho_2k+1, summed while G_k is positive and made
    non-increasing: the initial monotone sequence of Geyer (1992), Practical Markov chain Monte
    Carlo, Statistical Science 7, 473-483. The error is tau sqrt(2 (2W + 1) / N) for a sum over W
    lags: Madras and Sokal (1988), by way of Wolff, Monte Carlo errors with less errors,
    hep-lat/0306017; the term that would make it smaller is left out.
    """
    rho = autocorrelation(series)
    n = len(rho)
    pairs = rho[: 2 * (n // 2)].reshape(-1, 2).sum(axis=1)
    if not len(pairs):
        return 1.0, 0.0
    end = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
    tau = max(1.0, -1.0 + 2.0 * float(np.minimum.accumulate(pairs[:end]).sum()))
    window = max(2 * end - 1, 0)
    return tau, tau * float(np.sqrt(2.0 * (2 * window + 1) / n))


def effective_samples(series: ArrayLike) -> float:
    """Effective samples of a finite series (N,) in time order: N over tau, 0 for an empty one.

    One standard error is added to tau, for a short series underrates its own correlation. Measured
    on consistent AR(1) errors, a mean test at 0.1 % then accuses 0.0 to 1.6 % of logs instead of up
    to 4.6 % (1 and 3 degrees of freedom, 100 to 2000 samples, rho 0 to 0.99, `insufficient` below
    20 effective samples).
    """
    n = len(np.asarray(series))
    if n == 0:
        return 0.0
    tau, error = autocorrelation_time(series)
    return min(float(n), max(1.0, n / (tau + error)))
