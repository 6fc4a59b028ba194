"""Brackets, medians over few seeds, and paired differences."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from slamreplay.doses.plan import of_levels, of_search
from slamreplay.doses.search import next_levels
from slamreplay.replay.dose_statistics import (
    Bracket,
    bracket_of,
    critical_of,
    holds_again,
    median_ranks,
    paired,
)


def test_a_bracket_ends_at_the_first_crossing():
    tried = {0.0: False, 1.0: False, 2.0: True, 3.0: False, 4.0: True}

    assert bracket_of(tried) == Bracket(1.0, 2.0)
    assert holds_again(tried) == [3.0]


def test_what_has_no_number_is_passed_over():
    assert bracket_of({0.0: False, 1.0: None, 2.0: True}) == Bracket(0.0, 2.0)
    assert bracket_of({0.0: False, 1.0: False, 2.0: None}) == Bracket(1.0, math.inf)
    assert bracket_of({0.0: None}) is None


def test_broken_at_the_baseline_is_a_bracket_of_no_width():
    assert bracket_of({0.0: True, 1.0: False}) == Bracket(0.0, 0.0)


@pytest.mark.parametrize("n", range(2, 60))
def test_ranks_are_those_of_the_binomial_distribution(n):
    rank, confidence = median_ranks(n)

    between = stats.binom.cdf(n - 1 - rank, n, 0.5) - stats.binom.cdf(rank, n, 0.5)
    assert confidence == pytest.approx(between)
    if n >= 6:
        assert confidence >= 0.95
        assert 1.0 - 2.0 * stats.binom.cdf(rank + 1, n, 0.5) < 0.95
    else:
        assert rank == 0
    assert median_ranks(5)[1] == 0.9375


def test_the_interval_covers_the_median_as_often_as_it_says():
    rng = np.random.default_rng(0)
    ladder = np.arange(0.0, 90.0, 0.25)
    hits, logs = 0, 2000
    for _ in range(logs):
        crossings = rng.gamma(2.0, 3.0, 7)
        brackets = [
            Bracket(float(ladder[ladder < c].max()), float(ladder[ladder >= c].min()))
            for c in crossings
        ]
        found = critical_of("error_max_m", brackets, 0.0, 1)
        hits += found.low <= stats.gamma.median(2.0, scale=3.0) <= found.high

    assert found.confidence == pytest.approx(0.984375)
    assert hits / logs >= found.confidence - 0.01


def test_half_of_the_seeds_make_a_crossing_and_fewer_do_not():
    held, broke = Bracket(4.0, math.inf), Bracket(1.0, 2.0)

    half = critical_of("m", [broke, broke, held, held], 0.0, 1)
    fewer = critical_of("m", [broke, held, held], 0.0, 1)
    none = critical_of("m", [held, held], 0.0, 1)

    assert (half.outcome, half.level, half.high, half.crossed) == ("crossed", 2.0, None, 2)
    assert (fewer.outcome, fewer.level, fewer.low, fewer.high) == ("partly", None, 1.0, None)
    assert (none.outcome, none.low, none.high) == ("never", 4.0, None)


def test_a_single_seed_has_a_bracket_and_no_confidence():
    found = critical_of("m", [Bracket(0.3, 0.4)], 1.0, -1)

    assert (found.level, found.low, found.high) == (0.6, 0.7, 0.6)
    assert found.confidence is None


def test_nothing_known_is_not_applicable_and_a_broken_baseline_is_always():
    assert critical_of("m", [None, None], 0.0, 1).outcome == "not_applicable"
    always = critical_of("m", [Bracket(0.0, 0.0)] * 3, 0.0, 1)
    assert (always.outcome, always.level) == ("always", 0.0)


brackets = st.lists(
    st.tuples(st.floats(0, 100), st.one_of(st.just(math.inf), st.floats(0, 100))).map(
        lambda pair: Bracket(pair[0], pair[0] + pair[1])
    ),
    min_size=1,
    max_size=30,
)


@given(brackets)
def test_an_interval_is_never_tighter_than_a_bracket_of_the_median(seeds):
    found = critical_of("m", seeds, 0.0, 1)
    high = math.inf if found.high is None else found.high

    if found.level is not None:
        assert found.low <= found.level <= high
        narrowest = min(b.broke - b.held for b in seeds)
        assert high - found.low >= narrowest - 1e-9
    assert found.crossed == sum(math.isfinite(b.broke) for b in seeds)


def test_paired_differences_are_students():
    rng = np.random.default_rng(1)
    pairs = rng.normal(size=(7, 2))

    found = paired([tuple(pair) for pair in pairs.tolist()])

    truth = stats.ttest_rel(pairs[:, 0], pairs[:, 1]).confidence_interval(0.95)
    assert found.mean == pytest.approx((pairs[:, 0] - pairs[:, 1]).mean())
    assert (found.low, found.high) == pytest.approx(tuple(truth))
    assert found.n == 7
    assert paired([(3.0, 1.0)]) == type(found)(2.0, None, None, 1)
    assert paired([]) is None


def searched(axis, response, limit=1.0, most=60):
    """Levels a search tries of one seed, and whether they cross."""
    tried = {axis.baseline: response(axis.baseline) > limit}
    for _ in range(most):
        fresh = next_levels(axis, tried)
        if not fresh:
            return tried
        for level in fresh:
            assert level not in tried
            value = response(level)
            tried[level] = None if value is None else value > limit
    pytest.fail("the search does not end")
    return tried


@given(st.floats(0.001, 9.99), st.sampled_from([0.5, 0.1, 0.02]))
def test_a_search_ends_with_a_bracket_about_the_crossing(critical, tolerance):
    axis = of_search("initial_pose.offset", 0.0, 10.0, tolerance)

    bracket = bracket_of(searched(axis, lambda level: 2.0 if level >= critical else 0.0))

    assert bracket.held < critical <= bracket.broke
    assert bracket.broke - bracket.held <= tolerance * 1.001


@given(st.floats(0.02, 9.0))
def test_a_search_by_factors_finds_it_too(critical):
    axis = of_search("initial_pose.offset", 0.01, 10.0, 0.005)

    tried = searched(axis, lambda level: 2.0 if level >= critical else 0.0)

    bracket = bracket_of(tried)
    assert axis.by_factor
    assert bracket.held < critical <= bracket.broke
    assert len(tried) <= 6 + 13


@given(st.floats(0.51, 0.999))
def test_a_search_below_the_baseline_finds_it_too(critical):
    axis = of_search("odometry_scale.rotation", 1.0, 0.5, 0.02)

    tried = searched(axis, lambda level: 2.0 if level <= critical else 0.0)

    held = min(level for level, is_so in tried.items() if not is_so)
    broke = max(level for level, is_so in tried.items() if is_so)
    assert broke <= critical < held
    assert held - broke <= 0.02 * 1.001


def test_a_search_ends_where_nothing_crosses_or_everything_does():
    axis = of_search("initial_pose.offset", 0.0, 10.0, 0.1)

    assert len(searched(axis, lambda level: 0.0)) == 6
    assert len(searched(axis, lambda level: 2.0)) == 6  # the ladder is for the picture
    assert len(searched(axis, lambda level: None if level > 0 else 0.0)) == 6


def test_a_level_without_a_number_is_not_asked_for_again():
    axis = of_search("initial_pose.offset", 0.0, 10.0, 0.1)

    tried = searched(axis, lambda level: 2.0 if level >= 4 else None if level > 2 else 0.0)

    assert tried[4.0] is True


def test_levels_are_tried_once_and_whole():
    axis = of_levels("tf_delay", [0.1, 0.4, 0.2])

    assert next_levels(axis, {0.0: False}) == (0.1, 0.2, 0.4)
    assert next_levels(axis, {0.0: False, 0.1: True, 0.2: True, 0.4: True}) == ()
