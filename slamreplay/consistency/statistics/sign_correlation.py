"""How long errors of unit variance hang together, read off their signs.

A stretch of errors that are far too large makes any estimate from the errors themselves call them
correlated over the whole stretch, and then nothing is ever proven. Signs do not know sizes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.consistency.statistics.effective_samples import lagged_sums
from slamreplay.geometry.se2 import Array


def sign_correlation(white: ArrayLike) -> Array:
    """(N,) autocorrelation at lags 0 to N-1 of errors (N, m) of mean zero, averaged over m.

    Two normal variables of correlation rho agree in sign so often that the mean product of their
    signs is 2/pi arcsin(rho): Van Vleck and Middleton (1966), The spectrum of clipped noise, Proc.
    IEEE 54, 2-19. The mean of the products is over N at every lag, as in `autocorrelation`; no mean
    is taken away, so that a constant error counts as one that never changes.
    """
    signs = np.sign(np.asarray(white, dtype=np.float64))
    n = len(signs)
    if not n:
        return np.empty(0)
    products = lagged_sums(signs).mean(axis=1) / n
    return np.asarray(np.sin(np.pi / 2.0 * np.clip(products, -1.0, 1.0)))


def squares_time(white: ArrayLike) -> float:
    """Samples that are worth one independent square, of whitened errors (N, m) in time order.

    The squares of normal errors correlate as rho^2, so that tau = 1 + 2 sum rho_k^2, over the lags
    up to the first pair of them without a positive sum (Geyer 1992, as in `autocorrelation_time`).
    One standard error, tau sqrt(2 (2W + 1) / N) for W lags (Madras and Sokal 1988), is added.
    Without a sample it is 1.
    """
    rho = sign_correlation(white)
    n = len(rho)
    pairs = rho[: 2 * (n // 2)].reshape(-1, 2).sum(axis=1)
    if not len(pairs):
        return 1.0
    end = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
    window = 2 * end
    tau = 1.0 + 2.0 * float(np.sum(rho[1:window] ** 2))
    return tau * (1.0 + float(np.sqrt(2.0 * (2 * window + 1) / n)))
