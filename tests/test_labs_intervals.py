"""Shares and medians of a few logs, against scipy.stats."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from slamreplay.labs.intervals import median_interval, share_interval


@pytest.mark.parametrize(("hits", "n"), [(0, 7), (3, 20), (20, 20)])
def test_share_is_clopper_and_pearsons(hits, n):
    exact = stats.binomtest(hits, n).proportion_ci(0.95, method="exact")

    assert share_interval(hits, n) == pytest.approx((exact.low, exact.high))


@given(st.lists(st.floats(-1e6, 1e6), min_size=6, max_size=40))
def test_median_lies_between_two_order_statistics(values):
    median, low, high = median_interval(values)

    assert median == pytest.approx(np.median(values))
    ranked = stats.quantile_test(values, q=median, p=0.5).confidence_interval(0.95)
    assert (low, high) == (ranked.low, ranked.high)


def test_few_values_know_no_interval_and_what_never_came_is_endless():
    assert median_interval([3.0, 1.0, 2.0]) == (2.0, -math.inf, math.inf)
    assert median_interval([1.0] * 3 + [math.inf] * 3)[0] == math.inf
    assert median_interval([1.0] + [math.inf] * 9)[:2] == (math.inf, math.inf)
