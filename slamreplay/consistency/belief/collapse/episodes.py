"""Stretches in which errors are larger than their covariance allows: when they begin and end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtrc

from slamreplay.consistency.answers import P_ACCUSE
from slamreplay.consistency.statistics.sign_correlation import squares_time
from slamreplay.geometry.se2 import Array

#: Rows of the shortest window, and of the shortest episode: one bad row is no collapse.
FEWEST = 4
#: An episode is called one only where sigma is too small by this factor.
LEAST_FACTOR = 1.5
#: Sigma that is too small by the first factor makes an episode; its ends are sharpened with its own
#: factor, up to the second one, or a chance excursion shortly before would count as its begin.
_FACTOR, _SHARP = 2.0, 4.0
#: So many rows of a sound stretch end an episode, and so many independent ones.
_ROWS, _SOUND = 8.0, 2.0
#: No p-value is said to be smaller: it is not zero.
_TINY = 1e-300


@dataclass(frozen=True)
class Episode:
    """Rows in which errors are too large.

    Attributes:
        first: row at which they left what their covariance allows.
        last: last row of it.
        factor: sqrt of the mean square over its expectation: sigma is too small by this factor.
        p_value: sound data show such a stretch, somewhere, with at most this probability.
    """

    first: int
    last: int
    factor: float
    p_value: float


@dataclass(frozen=True)
class Scan:
    """The episodes of a series, in time order, and the p-value of its most striking window."""

    episodes: tuple[Episode, ...]
    p_value: float


def scan(white: ArrayLike) -> Scan:
    """Look through whitened errors (N, m), finite and in time order, for stretches too large.

    Windows of 4, 8, 16 and so on rows, a quarter of their length apart. The mean square of a window
    is held against chi-square of m times its independent samples, one at least; their number comes
    from the signs of the errors. P-values are multiplied by the number of windows of that length
    and by the number of lengths: the Bonferroni scan with critical values that depend on the
    length (Walther 2022, Calibrating the scan statistic with size-dependent critical values,
    arXiv:2107.08296). Measured on sound AR(1) errors (rho 0 to 0.998; 30 to 2000 rows; 1 to 3
    axes): below 0.05 in at most 3.0 % of the series, below 0.001 in one of 36 000.

    Begin and end are those of the largest sum of log-likelihood ratios about the worst row (Page
    1954, Continuous inspection schemes, Biometrika 41, 100-115), looked for until the sum has
    fallen by what a sound stretch of 8 rows, and 2 independent ones, takes away; then sharpened.
    """
    w = np.asarray(white, dtype=np.float64)
    n, dof = w.shape
    squares = np.sum(w**2, axis=1)
    tau = squares_time(w)
    first, stop, p = _windows(squares, dof, tau)
    if not len(p):
        return Scan((), 1.0)
    gain = _gain(squares, dof, _FACTOR)
    most = -max(_ROWS, _SOUND * tau) * float(_gain(dof, dof, _FACTOR))
    found: list[Episode] = []
    open_ = p < P_ACCUSE
    while open_.any():
        best = int(np.argmin(np.where(open_, p, np.inf)))
        worst = int(first[best] + np.argmax(squares[first[best] : stop[best]]))
        low = max((e.last + 1 for e in found if e.last < worst), default=0)
        high = min((e.first for e in found if e.first > worst), default=n)
        low, high = _about(worst, gain, low, high, most)
        open_ &= (stop <= low) | (first >= high)
        sharp = min(max(_too_small(squares[low:high], dof), _FACTOR), _SHARP)
        low, high = _about(worst, _gain(squares, dof, sharp), low, high, math.inf)
        factor = _too_small(squares[low:high], dof)
        found.append(Episode(low, high - 1, factor, float(p[best])))
    return Scan(tuple(_told(found)), float(min(1.0, p.min())))


def _windows(
    squares: Array, dof: int, tau: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """First row, row after the last, and p-value of every window."""
    n = len(squares)
    total = np.append(0.0, np.cumsum(squares))
    lengths = [FEWEST << k for k in range(max(0, (n // FEWEST).bit_length()))]
    parts = []
    for length in lengths:
        first = np.arange(0, n - length + 1, length // 4, dtype=np.int64)
        mean = (total[first + length] - total[first]) / length
        n_eff = max(1.0, length / tau)
        p = np.maximum(chdtrc(dof * n_eff, n_eff * mean), _TINY) * len(first) * len(lengths)
        parts.append((first, first + length, p))
    if not parts:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.empty(0)
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))  # type: ignore[return-value]


def _gain(squares: ArrayLike, dof: int, factor: float) -> Array:
    """Log-likelihood ratio of a sigma too small by `factor` against one that is right."""
    return np.asarray(squares) / 2.0 * (1.0 - factor**-2) - dof * math.log(factor)


def _too_small(squares: Array, dof: int) -> float:
    return math.sqrt(float(squares.mean()) / dof)


def _about(worst: int, gain: Array, low: int, high: int, most: float) -> tuple[int, int]:
    """First row, and the one after the last, of the largest sum of gains about a row."""
    begin = worst - _reach(gain[low:worst][::-1], most)
    return begin, worst + 1 + _reach(gain[worst + 1 : high], most)


def _reach(gain: Array, most: float) -> int:
    """How many rows from here on bring the largest sum, before it falls by `most` below that."""
    total = np.cumsum(gain)
    peak = np.maximum(np.maximum.accumulate(total), 0.0) if len(total) else total
    fallen = peak - total > most
    total = total[: int(np.argmax(fallen))] if fallen.any() else total
    return int(np.argmax(total)) + 1 if len(total) and total.max() > 0.0 else 0


def _told(found: list[Episode]) -> Iterator[Episode]:
    for episode in sorted(found, key=lambda e: e.first):
        if episode.last - episode.first + 1 >= FEWEST and episode.factor >= LEAST_FACTOR:
            yield episode
