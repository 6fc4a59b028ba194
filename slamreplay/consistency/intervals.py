"""Where the mean of a chi-square statistic must lie, given its effective number of samples."""

from __future__ import annotations

from scipy.special import chdtr, chdtrc, chdtri


def mean_interval(dof: int, n_eff: float, p: float) -> tuple[float, float]:
    """Two-sided interval of the mean of `n_eff` independent chi-square values, missed with `p`.

    The sum of n values of `dof` degrees of freedom is chi-square of n * dof (Bar-Shalom, Li,
    Kirubarajan 2001, section 5.4.2); n need not be whole. Quantiles come from scipy.special, which
    loads in a third of the time of scipy.stats and gives the same numbers.
    """
    total = dof * n_eff
    low, high = chdtri(total, 1.0 - p / 2.0), chdtri(total, p / 2.0)
    return float(low) / n_eff, float(high) / n_eff


def mean_p_value(dof: int, n_eff: float, mean: float) -> float:
    """Two-sided p-value of a mean of `n_eff` independent chi-square values of `dof`."""
    total, value = dof * n_eff, n_eff * mean
    return float(min(1.0, 2.0 * min(chdtr(total, value), chdtrc(total, value))))
