"""Poses and landmarks together: honest; in sequence: not."""

import numpy as np
import pytest

from slamreplay.graph.landmarks import Evidence, most_probable
from slamreplay.labs.joint_estimation.drive import Noise, drive
from slamreplay.labs.joint_estimation.trials import BY_STEPS, JOINT, MAP_FIRST, WAYS, estimated

NOISE = Noise(0.03, 0.02, 0.05, 0.02)


def one_landmark(sightings):
    """A robot that stands still and sees one landmark 2 m ahead, again and again."""
    return Evidence(
        np.zeros((1, 3)), np.diag([0.01, 0.01, 0.01])[None], np.zeros(sightings, dtype=np.int64),
        np.zeros(sightings, dtype=np.int64), np.zeros(sightings), np.full(sightings, 2.0), 0.1, 0.3,
    )  # fmt: skip


@pytest.mark.parametrize("exact", ["", "poses"])
def test_landmark_seen_from_a_known_pose(exact):
    found = most_probable(one_landmark(9), np.zeros((2, 3)), np.array([[1.5, 0.4]]), exact)

    assert found.landmarks == pytest.approx(np.array([[2.0, 0.0]]), abs=1e-6)
    # Nine sightings: range along, 2 m times the bearing across.
    assert found.landmark_cov[0] == pytest.approx(np.diag([0.1**2, (0.2 / 3.0) ** 2]), abs=1e-6)


def test_pose_in_a_map_that_is_taken_as_exact():
    places = np.array([[2.0, 0.0], [0.0, 2.0]])
    evidence = Evidence(
        np.zeros((1, 3)), np.eye(3)[None] * 1e6, np.array([1, 1]), np.array([0, 1]),
        np.array([0.0, np.pi / 2.0]), np.full(2, 2.0), 1e3, 0.3,
    )  # fmt: skip
    found = most_probable(evidence, np.zeros((2, 3)), places, "landmarks")

    assert found.xyyaw[1, :2] == pytest.approx(np.zeros(2), abs=1e-6)
    assert found.cov[1, :2, :2] == pytest.approx(np.diag([0.09, 0.09]), rel=1e-3, abs=1e-4)
    assert found.landmarks == pytest.approx(places)
    assert found.landmark_cov == pytest.approx(np.zeros((2, 2, 2)), abs=1e-9)


@pytest.mark.parametrize("way", WAYS)
def test_without_noise_every_way_finds_the_truth(way):
    none = Noise(1e-7, 1e-7, 1e-7, 1e-7)
    driven = drive(20.0, 0.5, 12, 6.0, none, np.random.default_rng(3))
    found = estimated(driven)[way]

    assert found.error_m.max() < 1e-4
    assert found.map_error_m < 1e-4


def test_only_the_joint_estimate_is_as_good_as_it_claims():
    nees = {way: [] for way in WAYS}
    errors = {way: [] for way in WAYS}
    for log in range(10):
        driven = drive(50.0, 0.5, 30, 5.0, NOISE, np.random.default_rng([7, log]))
        for way, trial in estimated(driven).items():
            nees[way].append(trial.nees.mean())
            errors[way].append(trial.error_m.mean())

    assert 2.0 < np.mean(nees[JOINT]) < 4.5
    assert np.mean(nees[MAP_FIRST]) > 300.0
    assert np.mean(nees[BY_STEPS]) > 30.0
    assert np.mean(errors[JOINT]) < 0.5 * np.mean(errors[BY_STEPS])
    assert np.mean(errors[BY_STEPS]) < np.mean(errors[MAP_FIRST])
