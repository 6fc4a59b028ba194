"""Stretches without a place between, before and after placed ones."""

from __future__ import annotations

import numpy as np
import pytest

from slamreplay.geometry import se2
from slamreplay.hindsight.bridging import Bridged, bridged

COUNT = 21
#: Keyframes 8 to 13 have no place.
HIDDEN = np.arange(8, 14)


def turning() -> se2.Array:
    """(COUNT, 3) true poses, 0.3 m and 2 degrees apart."""
    poses = np.zeros((COUNT, 3))
    for k in range(1, COUNT):
        poses[k] = se2.compose(poses[k - 1], np.array([0.3, 0.0, np.radians(2.0)]))
    return poses


def bring_back(
    poses: se2.Array, hidden: np.ndarray, odometry: se2.Array, torn: tuple[int, ...] = ()
) -> Bridged:
    has_place = np.ones(COUNT, dtype=bool)
    has_place[hidden] = False
    is_torn = np.zeros(COUNT - 1, dtype=bool)
    is_torn[list(torn)] = True
    cov = np.broadcast_to(np.diag([0.02, 0.02, 0.01]) ** 2, (COUNT, 3, 3))
    is_open = np.zeros(COUNT - 1, dtype=bool)
    is_open[10] = True
    return bridged(poses, cov, is_open, has_place, odometry, is_torn)


def test_stretch_that_scans_misplaced_lies_where_odometry_led():
    true = turning()
    misplaced = true.copy()
    misplaced[HIDDEN, 0] += 2.0
    elsewhere = se2.compose(np.array([5.0, -3.0, 1.0]), true)  # odometry has a frame of its own

    found = bring_back(misplaced, HIDDEN, elsewhere)

    assert found.has_place.all()
    assert not found.is_open.any()
    np.testing.assert_allclose(found.xyyaw, true, atol=1e-6)
    sigma_m = np.sqrt(found.cov[:, 0, 0])
    assert 0.03 < sigma_m[HIDDEN].min() < sigma_m[HIDDEN].max() < 0.15


@pytest.mark.parametrize("moved_m", [0.8, 3.0])
def test_nothing_is_carried_over_a_robot_that_was_carried(moved_m):
    true = turning()
    odometry = true.copy()
    odometry[11:, 1] -= moved_m

    found = bring_back(true, HIDDEN, odometry)

    assert np.flatnonzero(~found.has_place).tolist() == HIDDEN.tolist()
    assert found.is_open[10]


def test_end_of_a_stretch_beyond_a_torn_link_is_not_believed():
    true = turning()
    poses = true.copy()
    poses[7] += np.array([0.4, 0.4, 0.2])

    found = bring_back(poses, HIDDEN, true, torn=(6,))

    assert found.has_place.all()
    np.testing.assert_allclose(found.xyyaw, true, atol=1e-6)


@pytest.mark.parametrize("hidden", [np.arange(4), np.arange(17, COUNT)])
def test_ends_of_a_log_follow_odometry_that_scans_agree_with(hidden):
    true = turning()
    poses = true.copy()
    poses[hidden, 0] += 1.0

    found = bring_back(poses, hidden, true)
    refuted = bring_back(poses, hidden, true, torn=(1, 18))

    np.testing.assert_allclose(found.xyyaw, true, atol=1e-6)
    assert found.has_place.all()
    assert np.count_nonzero(~refuted.has_place) == 2


def test_no_farther_than_odometry_is_of_use():
    hidden = np.arange(1, COUNT)

    found = bring_back(turning(), hidden, turning())

    sigma_m = np.sqrt(np.linalg.eigvalsh(found.cov[:, :2, :2])[:, -1])
    assert 2 < np.count_nonzero(found.has_place) < COUNT
    assert sigma_m[found.has_place].max() <= 0.5 / 3.0
