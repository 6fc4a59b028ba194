"""The noncredibility index: by its definition, and an accusation only with cause."""

import numpy as np
import pytest
from beliefs import APART, COUPLED, ar1, context
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.consistency.answers import raised
from slamreplay.consistency.belief.credible import check
from slamreplay.consistency.evidence.parts import POSE
from slamreplay.consistency.statistics.credibility_index import credibility_index

NORMAL = np.random.default_rng(8).standard_normal((600, 3))


def by_definition(error, cov):
    """NCI and I2 row by row: of errors (N, m) with claimed covariances (N, m, m), no whitening."""
    actual = np.linalg.inv(sum(np.outer(e, e) for e in error) / len(error))
    gamma = [
        10 * np.log10((e @ np.linalg.inv(P) @ e) / (e @ actual @ e))
        for e, P in zip(error, cov, strict=True)
    ]
    return np.mean(np.abs(gamma)), np.mean(gamma)


def test_with_one_claim_for_all_rows_the_indices_are_those_of_the_raw_errors():
    stretch = np.array([[1.4, 0.3, 0.0], [0.0, 0.7, 0.2], [0.1, 0.0, 1.1]])
    made = context(NORMAL @ stretch)
    found = credibility_index(POSE.white(made.evidence[0]))
    nci, inclination = by_definition(made.evidence[0].error, made.evidence[0].cov)

    # The claims of `context` change by a billionth from row to row.
    assert found.nci == pytest.approx(nci, rel=1e-5)
    assert found.inclination == pytest.approx(inclination, rel=1e-5)


@given(st.floats(0.1, 10.0))
def test_a_wrong_scale_is_its_own_number_of_decibels(k):
    # White with the second moment of exactly I: the claim is off by the factor k and by no more.
    exact = NORMAL @ np.linalg.inv(np.linalg.cholesky(NORMAL.T @ NORMAL / 600)).T
    found = credibility_index(k * exact)

    assert found.inclination == pytest.approx(20 * np.log10(k), abs=1e-9)
    assert found.nci == pytest.approx(abs(found.inclination), abs=1e-9)
    assert found.worst == pytest.approx((k, k))
    assert found.p_direction == pytest.approx(1.0)


@given(st.integers(0, 10_000))
def test_turning_the_axes_changes_nothing(seed):
    from scipy.stats import special_ortho_group

    stretched = NORMAL * [2.0, 1.0, 0.5]
    turned = credibility_index(stretched @ special_ortho_group.rvs(3, random_state=seed).T)
    one = credibility_index(stretched)

    assert (turned.nci, turned.inclination) == pytest.approx((one.nci, one.inclination))
    assert turned.p_direction == pytest.approx(one.p_direction, rel=0.5, abs=1e-30)


def test_too_sure_in_one_direction_and_not_enough_in_another_is_seen_where_the_mean_is_right():
    white = NORMAL * np.sqrt([0.1, 0.1, 2.8])
    (finding,) = raised(check(context(white)))

    assert (white**2).sum(axis=1).mean() == pytest.approx(3.0, rel=0.1)
    assert (finding.id, finding.severity) == ("SR-CON-005", "warning")
    assert "not by one factor" in finding.message
    assert finding.value > finding.high


def test_a_wrong_scale_alone_is_told_in_decibels_and_left_to_the_mean():
    (small,) = raised(check(context(2.0 * NORMAL)))
    (large,) = raised(check(context(0.5 * NORMAL)))

    assert (small.severity, large.severity) == ("info", "info")
    assert "inclination +6.2 dB" in small.message
    assert "too small" in small.message
    assert "inclination -5.8 dB" in large.message
    assert "too large" in large.message
    assert "the same factor in every direction" in large.message


def test_a_bias_counts_as_error():
    found = credibility_index(NORMAL[:, :2] + [3.0, 0.0])

    assert found.actual[0, 0] == pytest.approx(10.0, rel=0.05)
    assert found.inclination > 3.0


def test_p_values_are_uniform_for_independent_credible_errors():
    # By how often they fall below 5 % and 50 %, for the samples there really are.
    from slamreplay.consistency.statistics.credibility_index import _p_values

    rng = np.random.default_rng(2)
    draws = rng.standard_normal((3000, 25, 3))
    p = np.array([_p_values(w.T @ w / 25, 25) for w in draws])

    np.testing.assert_allclose((p < 0.05).mean(axis=0), 0.05, atol=0.012)
    np.testing.assert_allclose((p < 0.5).mean(axis=0), 0.5, atol=0.03)


def test_consistent_errors_are_hardly_ever_accused_even_where_axes_change_at_their_own_pace():
    accused = 0
    for seed in range(100):
        rng = np.random.default_rng([seed, 1])
        white = np.column_stack([ar1(rng, 800, rho, 1) for rho in (0.95, 0.3, 0.8)])
        accused += bool(raised(check(context(white))))

    assert accused <= 1


def test_without_enough_rows_or_directions_there_is_no_index():
    flat = NORMAL.copy()
    flat[:, 2] = flat[:, 1]

    assert credibility_index(NORMAL[:3]) is None
    assert credibility_index(flat) is None
    assert credibility_index(np.zeros((50, 2))) is None
    assert credibility_index(np.full((50, 2), np.nan)) is None
    assert not credibility_index(NORMAL[:15]).sufficient


def test_rows_without_a_value_or_an_error_are_left_out():
    gaps = np.insert(NORMAL, [0, 100], np.nan, axis=0)
    gaps[50] = 0.0

    assert credibility_index(gaps).n == 599


def test_a_single_axis_and_shared_evidence_are_not_asked():
    assert [a.finding.id for a in check(context(3.0 * NORMAL, APART))] == ["SR-CON-005"]
    assert check(context(3.0 * NORMAL, COUPLED, kind="hindsight")) == ()
