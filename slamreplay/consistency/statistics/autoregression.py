"""Autoregressive models of zero-mean series: how errors of one log hang together in time."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.se2 import Array

#: No more than this many lags, nor than a quarter of the rows, are fitted.
ORDER_MAX = 20
#: What an estimated partial autocorrelation is kept below: 1 would never forget.
_ALMOST_ONE = 0.99999
#: A correlation below this is none.
_FORGOTTEN = 1e-12


def burg(series: Array, order: int) -> tuple[Array, Array]:
    """Reflection coefficients (order,) and share of variance left (order + 1,) of series (N, m).

    Burg's lattice: each coefficient minimises forward and backward prediction errors together, here
    summed over the columns, m realisations of one process of zero mean. Nothing is subtracted: a
    consistent error has no mean, and an estimated one would make short series look whiter.
    """
    from slamreplay.consistency.statistics.lattice import (
        reflections,  # numba takes a moment to load
    )

    rows = np.ascontiguousarray(series, dtype=np.float64)
    reflection = np.asarray(reflections(rows, order))
    left = np.append(1.0, np.cumprod(np.maximum(1.0 - reflection**2, 1e-12)))
    return reflection, left


def chosen_reflection(series: Array, *, sparing: bool = False) -> tuple[Array, float]:
    """Reflection coefficients of the order that Akaike's criterion chooses, and its value.

    AICc after Hurvich and Tsai (1989, Biometrika 76, 297-307), with Schwarz's criterion instead
    where `sparing`. The first coefficient is mended for its bias of -2 rho / N in series of known
    mean (White 1957, Ann. Math. Statist. 28, 798-802).

    Args:
        series: (N, m) as for `burg`.
        sparing: prefer lower orders.
    """
    n = series.size
    order = int(np.clip(len(series) // 4, 1, ORDER_MAX)) if len(series) > 1 else 0
    reflection, left = burg(series, order)
    p = np.arange(order + 1)
    penalty = p * np.log(n) if sparing else 2.0 * p * n / np.maximum(n - p - 2, 1)
    criterion = n * np.log(left) + penalty
    best = int(np.argmin(criterion))
    kept = reflection[:best].copy()
    kept[:1] = np.clip(kept[:1] * (1.0 + 2.0 / n), -_ALMOST_ONE, _ALMOST_ONE)
    return kept, float(criterion[best])


def autocorrelation_of(reflection: Array, n: int) -> Array:
    """(n,) autocorrelation at lags 0 to n - 1 of the process with reflection coefficients (p,).

    By Levinson's recursion up to lag p, beyond it by the model's own difference equation.
    """
    p = min(len(reflection), n - 1)
    rho, a, error = np.zeros(n), np.zeros(p), 1.0
    rho[0] = 1.0
    for k in range(p):
        r = reflection[k]
        rho[k + 1] = a[:k] @ rho[k:0:-1] + r * error
        a[:k] -= r * a[:k][::-1].copy()
        a[k] = r
        error *= 1.0 - r * r
    model = np.append(1.0, -a)
    end = min(n, p + 1 + _memory(model))
    if end > p + 1:
        from slamreplay.consistency.statistics.lattice import carried_on  # as above

        carried_on(rho, a, p + 1, end)
    return rho


def _memory(model: Array) -> int:
    """Lags after which nothing is left; to decay on through denormal numbers would take long."""
    slowest = float(np.abs(np.roots(model)).max(initial=0.0))
    if slowest < _FORGOTTEN:
        return 0
    return int(np.log(_FORGOTTEN) / np.log(slowest)) + 1 if slowest < 1.0 else np.iinfo(int).max
