"""Scan against odometry: who holds which direction."""

from __future__ import annotations

import numpy as np
import pytest

from slamreplay.hindsight.chain import SIGMA_M
from slamreplay.hindsight.weighing import weighed
from slamreplay.matching.correlative import Match

GUESS, WAY = np.array([3.0, 1.0, np.pi]), np.array([0.25, 0.0, 0.0])
POINTS = 100


def test_along_a_wall_odometry_is_believed_and_across_it_the_scan() -> None:
    held = POINTS / SIGMA_M**2
    laid = Match(np.array([3.2, 1.03, -np.pi + 0.02]), 0.9, np.diag([0.01 * held, held, held]))
    x, y, yaw = weighed(GUESS, laid, WAY, POINTS, SIGMA_M)
    assert x == pytest.approx(3.0, abs=1e-9)
    assert y == pytest.approx(1.03, abs=0.005)
    assert np.cos(yaw - laid.xyyaw[2]) == pytest.approx(1.0, abs=1e-4)


def test_a_scan_without_hold_leaves_odometry_alone() -> None:
    laid = Match(np.array([3.2, 1.1, 3.0]), 0.9, -np.eye(3))
    assert weighed(GUESS, laid, WAY, POINTS, SIGMA_M) == pytest.approx(GUESS)


def test_a_scan_that_refutes_odometry_is_taken_at_its_word() -> None:
    held = POINTS / SIGMA_M**2 * np.eye(3)
    laid = Match(GUESS + np.array([0.2, 0.0, 0.0]), 0.9, held)
    assert weighed(GUESS, laid, WAY, POINTS, SIGMA_M) == pytest.approx(laid.xyyaw)
