"""What is measured of a log, for limits and for a later comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from slamreplay.consistency.statistics.effective_samples import effective_samples
from slamreplay.geometry import se2
from slamreplay.verdict.latency.spread import spread


@dataclass(frozen=True)
class Measure:
    """One number of a log.

    Attributes:
        value: finite, or inf where an estimator has not a single pose.
        unit: of value, low and high; empty where there is none.
        low: end of its 95 % interval; None where there is none, as of a greatest value.
        high: the other end.
        n_eff: independent samples behind it; None where it is a count or a time.
        of_seeds: of an estimator, the number of each seed's run, of which `value` is the worst.
    """

    value: float
    unit: str
    low: float | None = None
    high: float | None = None
    n_eff: float | None = None
    of_seeds: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Series:
    """One number over time.

    Attributes:
        t_ns: (N,) ascending.
        values: (N,) NaN where it is not known.
        unit: of them.
    """

    t_ns: NDArray[np.int64]
    values: se2.Array
    unit: str


@dataclass(frozen=True, eq=False)
class Measures:
    """All numbers of one log; each name of `METRICS` is in one of the three mappings.

    Attributes:
        start_ns: of the log.
        end_ns: of it.
        values: numbers per log by name; of estimators as `ESTIMATOR.NAME`.
        series: numbers over time by name.
        missing: by name, why the log does not tell it.
    """

    start_ns: int
    end_ns: int
    values: Mapping[str, Measure]
    series: Mapping[str, Series] = field(default_factory=dict)
    missing: Mapping[str, str] = field(default_factory=dict)


#: A number, or why there is none.
Answer = Measure | str


def mean_of(values: ArrayLike, unit: str, most: float | None = None) -> Measure:
    """The mean of numbers (N,) in time order, NaN left out, with its 95 % interval.

    Student's t for the effective number of samples: their scatter about their own mean is smaller
    than that about the true one by (n_eff - 1) / n_eff. None below two effective samples.

    Args:
        values: not negative, one of them finite.
        unit: of them.
        most: what none of them can be above; None where there is no such number.
    """
    x = np.asarray(values, dtype=np.float64)
    x = x[np.isfinite(x)]
    mean, n_eff = float(x.mean()), effective_samples(x)
    if n_eff < 2.0:
        return Measure(mean, unit, n_eff=n_eff)
    half = float(stdtrit(n_eff - 1.0, 0.975) * x.std() / np.sqrt(n_eff - 1.0))
    high = mean + half if most is None else min(most, mean + half)
    return Measure(mean, unit, max(0.0, mean - half), high, n_eff)


def p95_of(values: ArrayLike, unit: str) -> Measure:
    """What 95 of 100 numbers (N,) in time order are below, with its interval as of `spread`."""
    told = spread(values)
    assert told.p95 is not None
    return Measure(told.p95, unit, told.p95_low, told.p95_high, told.n_eff)
