"""Intervals of shares and rates against scipy's, published examples and simulated fleets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from slamreplay.consistency.statistics.shares import wilson
from slamreplay.fleet.intervals import (
    dispersion,
    effective,
    effective_pair,
    garwood,
    intraclass_correlation,
    newcombe,
    z_of,
)


@settings(deadline=None)
@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_is_scipys(counts):
    x, n = counts
    expected = stats.binomtest(x, n).proportion_ci(0.95, method="wilson")
    assert wilson(x / n, n) == pytest.approx((expected.low, expected.high), abs=1e-9)


@settings(deadline=None)
@given(st.integers(0, 300), st.floats(0.01, 1000.0))
def test_garwood_is_by_quantiles_of_chi_squared(x, exposure):
    low = stats.chi2.ppf(0.025, 2 * x) / 2 if x else 0.0
    high = stats.chi2.ppf(0.975, 2 * x + 2) / 2
    assert garwood(x, exposure) == pytest.approx((low / exposure, high / exposure), rel=1e-9)


def test_newcombe_gives_the_published_example():
    # Newcombe 1998, table II, (a): 56/70 - 48/80, method 10.
    low, high = newcombe((48 / 80, 80), (56 / 70, 70))
    assert (low, high) == pytest.approx((0.0524, 0.3339), abs=5e-5)


@pytest.mark.parametrize("many", [1, 2, 15])
def test_many_intervals_hold_together(many):
    assert 2 * many * stats.norm.sf(z_of(many)) == pytest.approx(0.05)
    found = stats.binomtest(3, 20).proportion_ci(1.0 - 0.05 / many, method="wilson")
    assert wilson(3 / 20, 20, z_of(many)) == pytest.approx((found.low, found.high))


def test_logs_of_robots_that_do_not_differ_count_in_full():
    rng = np.random.default_rng(1)
    cluster = np.repeat(np.arange(200), 10)
    assert intraclass_correlation(rng.random(2000) < 0.3, cluster) < 0.02
    assert effective(cluster, 0.0) == 2000


def test_logs_that_repeat_their_robot_are_worth_one_each():
    cluster = np.repeat(np.arange(20), 5)
    yes = np.repeat(np.arange(20) % 3 == 0, 5)
    assert intraclass_correlation(yes, cluster) == pytest.approx(1.0)
    assert effective(cluster, 1.0) == pytest.approx(20.0)


def test_the_correlation_is_that_of_beta_binomial_robots():
    # Shares of Beta(a, b) have the intraclass correlation 1 / (a + b + 1).
    rng = np.random.default_rng(2)
    size = rng.integers(2, 30, 2000)
    share = np.repeat(rng.beta(1.0, 3.0, 2000), size)
    found = intraclass_correlation(rng.random(len(share)) < share, np.repeat(np.arange(2000), size))
    assert found == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize(
    ("yes", "cluster"), [([], []), ([True], [0]), ([True, False], [0, 0]), ([True, False], [0, 1])]
)
def test_what_cannot_be_told_is_no_correlation(yes, cluster):
    assert intraclass_correlation(np.array(yes, bool), np.array(cluster, np.int64)) == 0.0


def test_intervals_hold_the_truth_where_robots_differ():
    """The plain interval does not: the test would not see what it is for."""
    rng = np.random.default_rng(3)
    held, plain, trials = 0, 0, 400
    for _ in range(trials):
        size = rng.integers(5, 40, 12)
        cluster = np.repeat(np.arange(12), size)
        yes = rng.random(len(cluster)) < np.repeat(rng.beta(1.5, 6.0, 12), size)
        share, n = yes.mean(), effective(cluster, intraclass_correlation(yes, cluster))
        for_n, for_all = wilson(share, n), wilson(share, len(yes))
        held += for_n[0] <= 0.2 <= for_n[1]
        plain += for_all[0] <= 0.2 <= for_all[1]
    assert held / trials > 0.88
    assert plain / trials < 0.75


def test_what_is_peculiar_to_a_robot_cancels_where_it_ran_both():
    one, two = np.repeat([0, 1], 20), np.repeat([2, 3], 20)
    apart, same = effective_pair(one, two, 0.3), effective_pair(one, one, 0.3)
    assert apart == pytest.approx((effective(one, 0.3), effective(two, 0.3)))
    assert same == (40.0, 40.0)
    half = effective_pair(one, np.repeat([0, 2], 20), 0.3)
    assert apart[0] < half[0] < same[0]


def test_dispersion_is_that_of_the_counts():
    rng = np.random.default_rng(4)
    expected = np.full(3000, 5.0)
    assert dispersion(rng.poisson(expected).astype(float), expected, 1) == pytest.approx(1, abs=0.1)
    # Negative binomial of variance 5 + 25 / 2.
    wide = rng.negative_binomial(2, 2 / 7, 3000).astype(float)
    assert dispersion(wide, expected, 1) == pytest.approx(3.5, rel=0.1)
    assert dispersion(np.zeros(1), np.ones(1), 1) == 1.0
