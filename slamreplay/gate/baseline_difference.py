"""Is a difference between two runs of a gate more than noise that hangs together in time?

The textbook's t-test takes every block of a log for an independent one. What differs between two
runs of the same log is a path that was taken a little otherwise, and that lasts: at a correlation
of 0.9 from block to block the textbook's 0.1 % are 48 %. The mean of a series is therefore held
against its long-run variance, by the cosine test that Lazarus, Lewis, Stock and Watson recommend
(2018, HAR inference: recommendations for practice, JBES 36, 541-559, eq. 10): the variance of
sqrt(n) times the mean is the mean square of the first nu type II cosine coefficients,

    Omega = 1/nu sum_j L_j^2,  L_j = sqrt(2/n) sum_t y_t cos(pi j (t - 1/2) / n),

and mean / sqrt(Omega / n) is Student's t of nu degrees of freedom. They take nu = 0.4 n^(2/3); that
is too many where a series is slow, so that here nu is a third of its independent samples. What
this holds and what not was measured: `recipes/ci-gate/baseline.md`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtr, stdtrit

from slamreplay.consistency.statistics.mean_test import N_EFF_MIN, NOMINAL
from slamreplay.geometry.se2 import Array

#: Independent samples for each cosine.
_PER_COSINE = 3
#: Groups that a correlation is estimated from at least.
_GROUPS_MIN = 12
#: Runs of seeds, and logs of a gate, that a mean over them takes: each is independent of the rest.
UNITS_MIN = 5
#: An estimated correlation is kept below this.
_ALMOST_ONE = 0.9999


@dataclass(frozen=True)
class Mean:
    """The mean of a series, and how well it is known.

    Attributes:
        n: values.
        mean: of them; NaN without one.
        n_eff: independent ones among them.
        error: standard error of the mean.
        dof: degrees of freedom of that.
    """

    n: int
    mean: float
    n_eff: float
    error: float
    dof: float


@dataclass(frozen=True)
class Difference:
    """New against old.

    Attributes:
        old: mean of the baseline, over what both have where they are paired.
        new: mean now.
        mean: new minus old.
        low: lower end of its 95 % interval; NaN where there is none.
        high: the other end.
        p_value: two-sided, of no difference; None where nothing was tested: all is identical, or
            there is too little.
        n_eff: independent samples behind it, the fewer of two sides.
        n: pairs, or values of the side that has fewer.
        needed: independent samples below which nothing is said.
        identical: whether every pair is equal to the last digit that is kept.
        error: standard error of `mean`; NaN where it cannot be told.
        dof: degrees of freedom of that.
    """

    old: float
    new: float
    mean: float
    low: float
    high: float
    p_value: float | None
    n_eff: float
    n: int
    needed: int = N_EFF_MIN
    identical: bool = False
    error: float = math.nan
    dof: float = 0.0

    @property
    def enough(self) -> bool:
        """Whether there are independent samples enough to say anything."""
        return self.n_eff >= self.needed


def mean_over_time(values: ArrayLike) -> Mean:
    """The mean of a series (N,) in time order that hangs together; NaN is left out.

    A series that never changes is known exactly: its standard error is 0.
    """
    y = np.asarray(values, dtype=np.float64)
    y = y[np.isfinite(y)]
    n = len(y)
    if n < 2:
        return Mean(n, float(y[0]) if n else math.nan, float(n), math.nan, 0.0)
    mean = float(y.mean())
    centred = y - mean
    if float(np.ptp(y)) == 0.0:
        return Mean(n, mean, float(n), 0.0, float(n - 1))
    n_eff = samples_of_mean(y)
    nu = max(1, min(int(n_eff / _PER_COSINE), n - 1))
    phases = np.pi * np.outer(np.arange(1, nu + 1), (np.arange(n) + 0.5) / n)
    omega = float(np.mean((np.cos(phases) @ centred) ** 2)) * 2.0 / n
    return Mean(n, mean, n_eff, math.sqrt(omega / n), float(nu))


def samples_of_mean(values: ArrayLike) -> float:
    """Independent samples that a finite series (N,) is worth to its mean, 1 to N.

    N / tau with tau = 1 + 2 sum_k (1 - k/N) rho^k of a first-order model, the longest of several:
    one of the series, one of the signs about its median (bursts hide how long they hang together),
    and one each of the means of 4, 8, 16, ... neighbours, for a slow part under white noise is not
    seen between neighbours. The estimate of rho is mended for its bias of -(1 + 3 rho) / N where
    the mean is not known (Marriott and Pope 1954, Biometrika 41, 390-402; Kendall 1954, ibid.
    403-404).
    """
    y = np.asarray(values, dtype=np.float64)
    n = len(y)
    centred = y - y.mean()
    power = float(np.mean(centred**2))
    if n < 3 or power == 0.0:
        return float(n)
    signs = np.sign(y - np.median(y))
    agree = float(np.mean(signs[1:] * signs[:-1]))
    # Van Vleck: signs of normal values correlate as 2/pi arcsin(rho).
    tau = max(_tau(_neighbours(centred), n), _tau(math.sin(math.pi / 2.0 * agree), n))
    size = 4
    while n // size >= _GROUPS_MIN:
        groups = _groups(centred, size)
        long_run = size * float(np.var(groups)) * _tau(_neighbours(groups), len(groups))
        tau, size = max(tau, long_run / power), 2 * size
    return max(1.0, n / tau)


def _neighbours(centred: Array) -> float:
    """Correlation of a series with its next value, as Burg has it."""
    ahead, behind = centred[1:], centred[:-1]
    power = float(ahead @ ahead + behind @ behind)
    return 2.0 * float(ahead @ behind) / power if power > 0.0 else 0.0


def _groups(series: Array, size: int) -> Array:
    """Means of `size` neighbours each; what is left over is shared by both ends."""
    count = len(series) // size
    first = (len(series) - count * size) // 2
    return np.asarray(series[first : first + count * size].reshape(count, size).mean(axis=1))


def _tau(rho: float, n: int) -> float:
    """Samples that are worth one independent, from an estimated correlation of neighbours."""
    rho = min(rho + (1.0 + 3.0 * rho) / n, _ALMOST_ONE)
    k = np.arange(1, n)
    return max(1.0, 1.0 + 2.0 * float(np.sum((1.0 - k / n) * rho**k)))


def paired(old: ArrayLike, new: ArrayLike) -> Difference:
    """Two series (N,) on one grid of time, of the same log; only where both have a value."""
    before, after = np.asarray(old, dtype=np.float64), np.asarray(new, dtype=np.float64)
    both = np.isfinite(before) & np.isfinite(after)
    before, after = before[both], after[both]
    step = mean_over_time(after - before)
    same = np.array_equal(before, after)
    return _difference(_mean(before), _mean(after), step, N_EFF_MIN, identical=same)


def unpaired(old: ArrayLike, new: ArrayLike) -> Difference:
    """Two series of different logs, each with its own long-run variance and degrees of freedom.

    Welch's test (1947, Biometrika 34, 28-35).
    """
    before, after = mean_over_time(old), mean_over_time(new)
    parts = (before.error**2, after.error**2)
    error = math.sqrt(sum(parts)) if before.dof and after.dof else math.nan
    spread = sum(part**2 / side.dof for part, side in zip(parts, (before, after), strict=True)
                 if side.dof)  # fmt: skip
    dof = error**4 / spread if spread > 0.0 else min(before.dof, after.dof)
    n_eff, n = min(before.n_eff, after.n_eff), min(before.n, after.n)
    step = Mean(n, after.mean - before.mean, n_eff, error, dof)
    return _difference(before.mean, after.mean, step, N_EFF_MIN, identical=False)


def over_units(old: Sequence[float], new: Sequence[float], *, by_ratio: bool = False) -> Difference:
    """A number of each seed or of each log, then and now: Student's t-test of the differences.

    Units are independent of each other. They need not be known equally well: at levels of 5 % and
    below the test errs to the safe side where variances differ (Bakirov and Szekely 2005, by way
    of Ibragimov and Mueller 2010, t-statistic based correlation and heterogeneity robust inference,
    JBES 28, 453-468). Signs alone, flipped at random, could not fall below 2^(1 - n).

    Args:
        old: of each unit, in the baseline.
        new: of the same units, now.
        by_ratio: take the p-value of the logarithms where all numbers are above 0 and agree with
            the difference of the means about its side: errors scatter in proportion to their size,
            and one run that went far astray would hide that all others went wrong, too.
    """
    before, after = np.asarray(old, dtype=np.float64), np.asarray(new, dtype=np.float64)
    known = np.isfinite(before) & np.isfinite(after)
    before, after = before[known], after[known]
    found = _difference(_mean(before), _mean(after), _step(before, after), UNITS_MIN,
                        identical=np.array_equal(before, after))  # fmt: skip
    if by_ratio and found.p_value is not None and min(before.min(), after.min()) > 0.0:
        ratio = _step(np.log(before), np.log(after))
        if ratio.mean * found.mean > 0.0:
            return replace(found, p_value=_p_value(ratio))
    return found


def _step(before: Array, after: Array) -> Mean:
    """The mean of differences that are independent of each other."""
    d, n = after - before, len(before)
    error = float(d.std(ddof=1)) / math.sqrt(n) if n > 1 else math.nan
    return Mean(n, _mean(d), float(n), error, float(n - 1))


def over_logs(each: Sequence[Difference]) -> Difference:
    """The mean of the differences of several logs: a small one everywhere shows here alone.

    Its variance is that of the logs' own errors and, where the logs differ by more than these tell,
    the rest of the variance between logs; the degrees of freedom are Satterthwaite's (1946,
    Biometrics Bulletin 2, 110-114) of all parts. A log with too few samples to be judged alone
    counts here all the same: that it knows its own error badly is in its degrees of freedom.
    """
    known = [d for d in each if d.n and math.isfinite(d.mean)]
    n = len(known)
    plain = over_units([d.old for d in known], [d.new for d in known])
    same = n > 0 and all(d.identical for d in known)
    if same or n < UNITS_MIN or not all(math.isfinite(d.error) for d in known):
        return replace(plain, identical=same)
    own = [(d.error / n) ** 2 for d in known]
    rest = max(0.0, plain.error**2 - sum(own))
    variance = sum(own) + rest
    shares = sum(v**2 / d.dof for v, d in zip(own, known, strict=True)) + rest**2 / (n - 1)
    dof = variance**2 / shares if shares > 0.0 else float(n - 1)
    mean = math.fsum(d.mean for d in known) / n
    step = Mean(n, mean, float(n), math.sqrt(variance), dof)
    return _difference(plain.old, plain.new, step, UNITS_MIN, identical=False)


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else math.nan


def _difference(old: float, new: float, step: Mean, needed: int, *, identical: bool) -> Difference:
    enough = step.n_eff >= needed
    if identical and step.n:
        return Difference(old, new, 0.0, 0.0, 0.0, None, step.n_eff, step.n, needed, identical=True,
                          error=0.0, dof=1.0)  # fmt: skip
    low = high = math.nan
    p_value = None
    if step.dof and math.isfinite(step.error):
        half = float(stdtrit(step.dof, 1.0 - NOMINAL / 2.0)) * step.error
        low, high = step.mean - half, step.mean + half
        if enough:
            p_value = _p_value(step)
    return Difference(old, new, step.mean, low, high, p_value, step.n_eff, step.n, needed,
                      error=step.error, dof=step.dof)  # fmt: skip


def _p_value(step: Mean) -> float:
    """Two-sided. The same difference everywhere is no accident."""
    if step.error == 0.0:
        return 0.0 if step.mean else 1.0
    return 2.0 * float(stdtr(step.dof, -abs(step.mean) / step.error))
