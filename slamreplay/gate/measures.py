"""What is measured of a log, for limits and for a later comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2


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
