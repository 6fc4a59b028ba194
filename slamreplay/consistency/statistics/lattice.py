"""Burg's lattice, compiled; a test holds it against plain numpy."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def reflections(series, order):  # type: ignore[no-untyped-def]
    """(order,) reflection coefficients of a contiguous series (N, m); see `autoregression.burg`."""
    n, m = series.shape
    forward, backward = series.copy(), series.copy()
    out = np.zeros(order)
    for k in range(order):
        power = product = 0.0
        for t in range(n - k - 1):
            for i in range(m):
                ahead, behind = forward[t + k + 1, i], backward[t, i]
                power += ahead * ahead + behind * behind
                product += ahead * behind
        r = 2.0 * product / power if power > 0.0 else 0.0
        out[k] = r
        for t in range(n - k - 1):
            for i in range(m):
                ahead, behind = forward[t + k + 1, i], backward[t, i]
                forward[t + k + 1, i] = ahead - r * behind
                backward[t, i] = behind - r * ahead
    return out


@njit(cache=True)
def carried_on(series, a, first, stop):  # type: ignore[no-untyped-def]
    """Fill a series from `first` up to `stop` by series[k] = sum over i of a[i] series[k - 1 - i].

    The least recent goes first into the sum, as in scipy's filters, which take long to load.
    """
    p = len(a)
    for k in range(first, stop):
        total = 0.0
        for i in range(p - 1, -1, -1):
            total += a[i] * series[k - 1 - i]
        series[k] = total
