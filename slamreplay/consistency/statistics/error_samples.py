"""How many independent samples the squares of correlated errors are worth.

The mean of T squared errors scatters as that of n_eff = T / tau independent ones. Squares of
jointly Gaussian errors of zero mean correlate as the square of the errors' own correlation
(Isserlis' theorem), so that tau = 1 + 2 sum (1 - k/T) rho_k^2, for AR(1) errors of a long log
(1 + rho^2) / (1 - rho^2). Whitened errors of a consistent belief have known mean and variance, and
only rho must be estimated: from models of the errors themselves, which tell more of it than the
squares do (with the squares the false alarms at a nominal 5 % were 9 to 19 %, with the errors 3 to
7 %; AR(1), rho 0.5 to 0.95, 20 and 50 effective samples).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.consistency.statistics.autoregression import autocorrelation_of, chosen_reflection
from slamreplay.geometry.se2 import Array

#: The model is fitted again to every 4th, 16th, ... row while there are so many: a slow part under
#: white noise lies beyond the lags that fit into one model.
_ROWS_MIN, _THIN = 60, 4
#: Gauss-Hermite nodes and weights of the standard normal: what rests on n_eff is averaged over
#: n_eff exp(spread * node), for n_eff is itself an estimate.
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
WEIGHTS = WEIGHTS / WEIGHTS.sum()
#: Standard normal quantile of 99.5 %.
_SURE = 2.576


@dataclass(frozen=True)
class ErrorSamples:
    """Independent samples among correlated ones.

    Attributes:
        n: samples.
        n_eff: independent ones among them, 1 to n; 0 where there is none.
        spread: relative standard error of n_eff: the correlation was estimated from the same log.
    """

    n: int
    n_eff: float
    spread: float

    @property
    def n_eff_max(self) -> float:
        """Upper end of the 99 % interval of n_eff, n at most."""
        return min(float(self.n), self.n_eff * (1.0 + _SURE * self.spread))


def error_samples(white: ArrayLike) -> ErrorSamples:
    """Of finite whitened errors (T, m) in time order.

    One model for all components or one for each, whichever Akaike's criterion prefers.
    """
    series = np.asarray(white, dtype=np.float64)
    n = len(series)
    if n < 2 or not series.any():
        return ErrorSamples(n, float(min(n, 1)), 0.0)
    models = _models(series, sparing=False)
    squares = np.mean([_squares(model, n) for model, _ in models], axis=0)
    tau, spread = 1.0 + 2.0 * float(squares.sum()), _spread(models, n)
    step = _THIN
    while n // step >= _ROWS_MIN:
        thinned = series[::step]
        models = _models(thinned, sparing=True)
        slow = np.mean([_squares(model, len(thinned)) for model, _ in models], axis=0)
        # Lags up to half a step are the finer model's to say; each thinned one stands for a step.
        longer = 1.0 + 2.0 * float(squares[: step // 2].sum()) + 2.0 * step * float(slow.sum())
        if longer > tau:
            tau, spread = longer, _spread(models, len(thinned))
        step *= _THIN
    return ErrorSamples(n, max(1.0, n / tau), spread)


def _models(series: Array, *, sparing: bool) -> list[tuple[Array, int]]:
    """Reflection coefficients of each kind of component, and the samples each was fitted to."""
    together, criterion = chosen_reflection(series, sparing=sparing)
    if series.shape[1] > 1:
        apart = [chosen_reflection(column[:, None], sparing=sparing) for column in series.T]
        if sum(value for _, value in apart) < criterion:
            return [(reflection, len(series)) for reflection, _ in apart]
    return [(together, series.size)]


def _squares(reflection: Array, n: int) -> Array:
    """(n - 1,) squared autocorrelation at lags 1 to n - 1, weighted by 1 - k/n."""
    rho = autocorrelation_of(reflection, n)
    return np.asarray((rho**2 * (1.0 - np.arange(n) / n))[1:])


def _spread(models: list[tuple[Array, int]], n: int) -> float:
    """Relative standard error of the models' mean tau.

    A reflection coefficient has variance (1 - r^2) / N; carried to tau of a first-order model that
    is a relative error of at most sqrt(2 tau / N).
    """
    taus = [1.0 + 2.0 * float(_squares(reflection, n).sum()) for reflection, _ in models]
    variance = sum(
        2.0 * tau**3 / count
        for tau, (reflection, count) in zip(taus, models, strict=True)
        if len(reflection)
    )
    return math.sqrt(variance) / sum(taus)
