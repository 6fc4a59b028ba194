"""Where the mean of a chi-square statistic over independent runs must lie."""

from __future__ import annotations

from scipy.special import chdtri


def mean_interval(dof: int, runs: float, p: float) -> tuple[float, float]:
    """Two-sided interval of the mean of independent chi-square values, missed with `p`.

    The sum of n values of `dof` degrees of freedom is chi-square of n * dof (Bar-Shalom, Li,
    Kirubarajan 2001, section 5.4.2). The values of one log are not independent: `mean_test` is for
    those. Quantiles come from scipy.special, which loads in a third of the time of scipy.stats.
    """
    total = dof * runs
    return float(chdtri(total, 1.0 - p / 2.0)) / runs, float(chdtri(total, p / 2.0)) / runs
