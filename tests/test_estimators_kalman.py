"""The worked numbers of the book, step by step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.estimators.kalman import correct, kalman_step, predict, range_prediction


def test_range_to_a_landmark_and_its_innovation():
    predicted, H = range_prediction([2.0, 1.0], [5.0, 1.0])

    step = correct([2.0, 1.0], np.diag([0.04, 0.04]), 2.7 - predicted, H, 0.01)

    assert predicted == pytest.approx(3.00)
    assert step.innovation[0] == pytest.approx(-0.30)
    np.testing.assert_allclose(H, [[-1.0, 0.0]])
    assert step.S[0, 0] == pytest.approx(0.05)  # 0.04 + 0.01: the covariance before the update
    assert step.x[0] == pytest.approx(2.0 + 0.3 * 0.8)  # nearer to the landmark than predicted


def test_range_at_the_landmark_itself_moves_nothing():
    predicted, H = range_prediction([1.0, 1.0], [1.0, 1.0])

    assert predicted == 0.0
    assert np.isfinite(correct([1, 1], np.eye(2), 0.1, H, 0.01).x).all()


@pytest.mark.parametrize(
    ("R", "gain", "x", "P"), [(0.20, 0.714, 3.43, 0.143), (2.0, 0.20, 3.12, 0.40)]
)
def test_one_dimensional_step(R, gain, x, P):
    prior, P_prior = predict(2.0, 0.40, 1.0, 0.10)
    step = kalman_step(2.0, 0.40, 1.0, 0.10, 3.6, R)

    assert (prior[0], P_prior[0, 0]) == pytest.approx((3.0, 0.50))
    assert step.gain[0, 0] == pytest.approx(gain, abs=5e-4)
    assert step.x[0] == pytest.approx(x, abs=5e-3)
    assert step.P[0, 0] == pytest.approx(P, abs=5e-4)
    assert step.innovation[0] == pytest.approx(0.6)
    assert step.S[0, 0] == pytest.approx(0.50 + R)


def test_a_noisier_measurement_moves_the_state_by_twelve_centimetres_only():
    step = kalman_step(2.0, 0.40, 1.0, 0.10, 3.6, 2.0)

    assert step.x[0] - 3.0 == pytest.approx(0.12)


@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.floats(0.01, 10.0))
def test_covariance_stays_symmetric_and_shrinks(entries, R):
    A = np.array(entries).reshape(3, 2)
    P = A.T @ A + 0.1 * np.eye(2)

    step = correct([0.0, 0.0], P, 1.0, [[1.0, 0.5]], R)

    np.testing.assert_allclose(step.P, step.P.T, atol=1e-12)
    assert (np.linalg.eigvalsh(P - step.P) > -1e-9).all()
    assert (np.linalg.eigvalsh(step.P) > 0).all()
