"""The shape of the errors: statistics against scipy, and an accusation only with cause."""

import numpy as np
import pytest
from beliefs import APART, COUPLED, ar1, context
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import chi2, kstest

from slamreplay.consistency.answers import raised
from slamreplay.consistency.belief.shape import check
from slamreplay.consistency.statistics.distribution import (
    LEVELS,
    distribution,
    ks_distance,
    ks_p_value,
)
from slamreplay.consistency.statistics.error_samples import error_samples

NORMAL = np.random.default_rng(5).standard_normal((400, 3))


def wild(rng, n, dof, share=0.04, times=5.0):
    """Errors of unit variance of which a few are far too large and all others too small."""
    scale = np.where(rng.random(n) < share, times, 1.0)
    scale /= np.sqrt(1 - share + share * times**2)
    return rng.standard_normal((n, dof)) * scale[:, None]


def alike(rng, n, dof):
    """Errors with the right mean square, all of one size: a mean test passes them."""
    e = rng.standard_normal((n, dof))
    return e / np.linalg.norm(e, axis=1, keepdims=True) * np.sqrt(dof)


# --- statistics ------------------------------------------------------------------------------


@pytest.mark.parametrize("dof", [1, 2, 3, 6])
def test_pit_coverage_and_distance_are_scipys(dof):
    white = np.random.default_rng(dof).standard_normal((120, dof)) * 1.2
    squared = (white**2).sum(axis=1)
    found = distribution(white)

    np.testing.assert_allclose(found.pit, np.sort(chi2.cdf(squared, dof)), rtol=1e-12)
    held = [(squared <= chi2.ppf(level, dof)).mean() for level in LEVELS]
    np.testing.assert_allclose(found.coverage, held)
    assert found.distance == pytest.approx(kstest(squared, chi2(dof).cdf).statistic, rel=1e-12)


@pytest.mark.parametrize(("n", "distance"), [(20, 0.3), (50, 0.12), (400, 0.09)])
def test_p_value_is_nearly_the_exact_one(n, distance):
    from scipy.stats import kstwo

    assert ks_p_value(distance, n) == pytest.approx(kstwo.sf(distance, n), rel=0.06)


def test_most_is_the_distance_that_chance_exceeds_in_one_of_twenty():
    found = distribution(NORMAL)

    assert ks_p_value(found.most, found.n_eff) == pytest.approx(0.05, rel=1e-6)


@given(arrays(np.float64, st.integers(1, 40), elements=st.floats(0, 1), unique=True))
def test_distance_without_ties_is_scipys(u):
    # Values that differ by less than their own rounding are ties to numpy and none to scipy.
    u = np.unique(np.round(u, 9))

    assert ks_distance(u) == pytest.approx(kstest(u, "uniform").statistic, abs=1e-12)


def test_rounded_poses_are_not_accused():
    # To a third of sigma: the errors' own distribution is right, but every value is a tie.
    white = np.round(NORMAL[:, :1] * 3.0) / 3.0
    found = distribution(white)

    assert found.p_value > 0.05
    assert kstest((white**2).ravel(), chi2(1).cdf).pvalue < 1e-4  # what plain ranks would say


def test_rows_without_a_value_are_left_out():
    gaps = np.insert(NORMAL, [0, 7, 400], np.nan, axis=0)

    assert distribution(gaps).distance == distribution(NORMAL).distance
    assert distribution(gaps).n == 400
    assert distribution(np.full((5, 2), np.nan)) is None
    assert distribution(np.empty((0, 3))) is None


def test_errors_that_are_all_zero_are_alike_and_break_nothing():
    found = distribution(np.zeros((30, 2)))

    assert found.coverage == (1.0,) * len(LEVELS)
    assert found.n_eff < 2.0
    assert not found.sufficient


@given(st.floats(0.05, 20.0))
def test_the_shape_does_not_depend_on_the_scale(k):
    one, scaled = distribution(NORMAL), distribution(k * NORMAL)

    assert scaled.p_shape == pytest.approx(one.p_shape, rel=1e-6)
    assert scaled.dispersion == pytest.approx(one.dispersion, rel=1e-6)
    assert scaled.n_eff == pytest.approx(one.n_eff)  # however small sigma is claimed


def test_correlated_errors_are_worth_fewer_samples_and_more_than_to_the_mean():
    errors = ar1(np.random.default_rng(1), 2000, 0.95, 1)
    found = distribution(errors)

    assert distribution(NORMAL).n_eff > 350
    assert error_samples(errors).n_eff < 0.6 * found.n_eff < found.n_eff < 250


@pytest.mark.parametrize(("rho", "n"), [(0.0, 200), (0.8, 228), (0.95, 976)])
def test_false_alarms_keep_to_their_nominal_rate(rho, n):
    naive = alarms = 0
    for seed in range(400):
        found = distribution(ar1(np.random.default_rng([seed, 3]), n, rho, 2))
        alarms += found.sufficient and found.p_value < 0.05
        naive += ks_p_value(found.distance, n) < 0.05

    assert 4 <= alarms <= 32  # 1 to 8 %
    assert rho == 0.0 or naive > 80  # what plain Kolmogorov and Smirnov would have done


# --- the check -------------------------------------------------------------------------------


def test_consistent_errors_are_hardly_ever_accused():
    accused = sum(
        bool(raised(check(context(ar1(np.random.default_rng([seed, 9]), 500, 0.9, 3), APART))))
        for seed in range(100)
    )

    assert accused <= 1


def test_a_few_wild_errors_with_the_right_variance_are_found():
    (answer,) = check(context(wild(np.random.default_rng(0), 500, 3)))
    (finding,) = raised([answer])

    assert (finding.id, finding.severity) == ("SR-CON-004", "warning")
    assert "a few errors are wild" in finding.message
    assert finding.value > finding.high
    assert finding.p_adjusted < 1e-3


def test_errors_that_are_all_of_one_size_are_found_although_their_mean_is_right():
    from slamreplay.consistency.belief.credibility import check as mean_is_tested

    made = context(alike(np.random.default_rng(0), 400, 3))
    (finding,) = raised(check(made))

    assert raised(mean_is_tested(made)) == ()
    assert "too much alike in size" in finding.message
    assert "50 %:" in finding.message


def test_a_wrong_scale_is_told_from_a_wrong_shape():
    (finding,) = raised(check(context(2.0 * NORMAL)))

    assert finding.severity == "info"
    assert "only the scale is at fault" in finding.message


def test_position_and_heading_are_judged_apart_where_nothing_couples_them():
    rng = np.random.default_rng(4)
    white = np.column_stack([wild(rng, 500, 2), rng.standard_normal(500)])
    answers = check(context(white, APART))

    assert len(answers) == 2  # each is a question, whatever comes out of it
    (finding,) = raised(answers)
    assert "position" in finding.message
    assert len(check(context(white, COUPLED))) == 1


def test_what_shares_evidence_and_what_is_too_short_is_not_asked():
    assert check(context(2.0 * NORMAL, kind="hindsight")) == ()
    assert check(context(2.0 * NORMAL[:15])) == ()
    assert check(context(2.0 * ar1(np.random.default_rng(0), 400, 0.999, 3))) == ()
