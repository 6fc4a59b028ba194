"""Landmarks and position fixes in the pose graph: what they must tie, and what they must not."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from slamreplay.geometry import se2
from slamreplay.graph.planar import smooth_chain
from slamreplay.graph.sightings import Fixes, Sightings

NO_ANCHORS = (np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3, 3)))
SIGMA = np.array([0.05, 0.05, 0.05])


def loop(count=40, radius=5.0):
    """Poses once around a circle and back to the start."""
    angle = np.linspace(0.0, 2 * np.pi, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), angle + np.pi / 2])


def drifting(truth, bias=(0.02, 0.0, 0.01)):
    """Motions that are a little wrong, and the poses they lead to."""
    motions = se2.between(truth[:-1], truth[1:]) + np.array(bias)
    poses = [truth[0]]
    for motion in motions:
        poses.append(se2.compose(poses[-1], motion))
    return motions, np.array(poses)


def smooth(poses, motions, *, anchors=NO_ANCHORS, is_open=None, **things):
    n = len(motions)
    return smooth_chain(
        poses,
        motions,
        np.tile(np.diag([0.03**2, 0.03**2, 0.015**2]), (n, 1, 1)),
        np.zeros(n, dtype=bool) if is_open is None else is_open,
        np.ones(n, dtype=bool),
        *anchors,
        **things,
    )


def anchored(truth, rows):
    cov = np.tile(np.diag([0.02**2, 0.02**2, 0.01**2]), (len(rows), 1, 1))
    return np.array(rows), truth[rows], cov


def sightings(truth, poses, rows, marks, *, known=False):
    """Every pose of `rows` sees every mark without noise; the marks begin where the poses say."""
    k, j = (a.ravel() for a in np.meshgrid(rows, np.arange(len(marks)), indexing="ij"))
    seen = se2.between(truth[k], marks[j])
    first = [se2.compose(poses[k[j == i][0]], seen[j == i][0]) for i in range(len(marks))]
    return Sightings(
        k,
        j,
        seen,
        np.tile(np.diag(SIGMA**2), (len(k), 1, 1)),
        marks if known else np.array(first),
        np.full(len(marks), known),
    )


def test_a_landmark_seen_again_bounds_the_drift_of_a_run_without_a_map():
    truth = loop()
    motions, poses = drifting(truth)
    marks = np.array([[6.0, 0.5, 0.3]])
    alone = smooth(poses, motions, anchors=anchored(truth, [0]))[0]
    seen = sightings(truth, poses, [0, 1, 38, 39], marks)
    tied, cov = smooth(poses, motions, anchors=anchored(truth, [0]), seen=seen)

    assert np.hypot(*(alone - truth)[-1, :2]) > 1.0
    assert np.hypot(*(tied - truth)[-1, :2]) < 0.15
    assert np.sqrt(cov[-1, 0, 0]) < 0.1


def test_surveyed_landmarks_alone_place_the_run_in_the_map():
    truth = loop()
    motions, poses = drifting(truth)
    shift = np.array([0.8, -0.5, 0.2])
    marks = np.array([[6.0, 0.5, 0.3], [-6.0, 1.0, 2.0]])
    seen = sightings(truth, poses, [0, 10, 20, 30, 39], marks, known=True)
    found, _ = smooth(se2.compose(shift, poses), motions, seen=seen)

    assert np.hypot(*(found - truth)[:, :2].T).max() < 0.1


def as_points(seen):
    """The sightings without headings."""
    xyyaw, initial = seen.xyyaw.copy(), seen.initial.copy()
    xyyaw[:, 2], initial[:, 2] = np.nan, np.nan
    return replace(seen, xyyaw=xyyaw, initial=initial)


@pytest.mark.parametrize("known", [False, True])
def test_points_bound_the_drift_without_a_heading(known):
    truth = loop()
    motions, poses = drifting(truth)
    marks = np.array([[6.0, 0.5, 0.3], [4.0, -2.0, 0.0]])
    anchors = NO_ANCHORS if known else anchored(truth, [0])
    alone = smooth(poses, motions, anchors=anchors)[0]
    seen = as_points(sightings(truth, poses, [0, 1, 38, 39], marks, known=known))
    tied, cov = smooth(poses, motions, anchors=anchors, seen=seen)

    assert np.hypot(*(alone - truth)[-1, :2]) > 1.0
    assert np.hypot(*(tied - truth)[-1, :2]) < 0.15
    assert np.sqrt(cov[-1, 0, 0]) < 0.1


def test_the_covariance_of_a_point_is_that_of_its_x_and_y():
    """One pose, two surveyed points: oracle is the linear estimate of the pose from x and y."""
    truth = np.array([[1.0, 2.0, 0.7], [1.5, 2.4, 0.7]])
    motions = se2.between(truth[:-1], truth[1:])
    marks = np.array([[4.0, 3.0, np.nan], [0.0, 6.0, np.nan], [-3.0, 1.0, np.nan]])
    seen = se2.between(truth[[0, 0, 0]], np.nan_to_num(marks))
    seen[:, 2] = np.nan
    cov = np.tile(np.diag([0.04, 0.09, 1.0]), (3, 1, 1))
    things = Sightings(np.zeros(3, dtype=int), np.arange(3), seen, cov, marks, np.ones(3, bool))
    found, spread = smooth(truth, motions, seen=things)

    c, s = np.cos(0.7), np.sin(0.7)
    R = np.array([[c, -s], [s, c]])
    information = np.diag(1.0 / np.array([2.0, 2.0, 1.0]) ** 2)
    for x, y, _ in seen:
        # x and y in the robot's axes, by its place (along these axes) and its heading.
        J = np.array([[-1.0, 0.0, y], [0.0, -1.0, -x]])
        noise = cov[0, :2, :2] + R.T @ np.diag([0.03**2, 0.03**2]) @ R
        information += J.T @ np.linalg.inv(noise) @ J
    body = np.linalg.inv(information)

    np.testing.assert_allclose(found[0], truth[0], atol=1e-6)
    np.testing.assert_allclose(spread[0, :2, :2], R @ body[:2, :2] @ R.T, rtol=0.02, atol=1e-4)
    np.testing.assert_allclose(spread[0, 2, 2], body[2, 2], rtol=0.02)


def test_one_sighting_of_another_tag_under_the_same_name_is_given_up():
    truth = loop()
    motions, poses = drifting(truth)
    marks = np.array([[6.0, 0.5, 0.3]])
    seen = sightings(truth, poses, [0, 1, 2, 37, 38, 39], marks)
    seen.xyyaw[2] += [4.0, 2.0, 1.0]
    found = smooth(poses, motions, anchors=anchored(truth, [0]), seen=seen)[0]

    assert np.hypot(*(found - truth)[-1, :2]) < 0.2


def test_an_unknown_landmark_seen_once_says_nothing():
    truth = loop()
    motions, poses = drifting(truth)
    anchors = anchored(truth, [0, 20])
    without, cov = smooth(poses, motions, anchors=anchors)
    seen = sightings(truth, poses, [30], np.array([[0.0, 0.0, 0.0]]))
    found, spread = smooth(poses, motions, anchors=anchors, seen=seen)

    np.testing.assert_allclose(found, without, atol=1e-4)
    np.testing.assert_allclose(spread, cov, rtol=1e-3, atol=1e-7)


@pytest.mark.parametrize("turn", [0.0, 1.9, -2.8])
def test_fixes_bound_the_drift_wherever_their_frame_lies(turn):
    truth = loop(radius=20.0)
    motions, poses = drifting(truth, bias=(0.03, 0.0, 0.004))
    frame = np.array([30.0, -12.0, turn])
    rows = np.arange(0, 40, 2)
    true_fixes = se2.between(frame, truth[rows])
    guess = true_fixes + np.array([0.0, 0.0, 0.05])  # of the heading only a guess is known
    cov = np.tile(np.diag([0.03**2, 0.1**2]), (len(rows), 1, 1))
    anchors = anchored(truth, [0, 8])
    start = frame + np.array([0.3, 0.2, 0.05])
    alone = smooth(poses, motions, anchors=anchors)[0]
    found = [
        smooth(poses, motions, anchors=anchors, fixes=Fixes(rows, at, cov, start))[0]
        for at in (true_fixes, guess)
    ]

    assert np.hypot(*(alone - truth)[:, :2].T).max() > 1.0
    assert np.hypot(*(found[0] - truth)[:, :2].T).max() < 0.2
    np.testing.assert_allclose(found[0], found[1], atol=0.02)


def test_the_robust_graph_is_gtsams_own():
    """Oracle: the same problem built line by line with gtsam and iterated to the end."""
    rng = np.random.Generator(np.random.PCG64(3))
    truth = loop(12)
    motions, poses = drifting(truth)
    seen = sightings(truth, poses, [0, 4, 8, 11], np.array([[6.0, 0.5, 0.3], [0.0, 0.0, 1.0]]))
    noisy = seen.xyyaw + 0.05 * rng.standard_normal(seen.xyyaw.shape)
    seen = Sightings(seen.pose_index, seen.landmark, noisy, seen.cov, seen.initial, seen.known)
    index, at, cov = anchored(truth, [0])
    found, spread = smooth(poses, motions, anchors=(index, at, cov), seen=seen)

    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k, pose in enumerate((*poses, *seen.initial)):
        values.insert(k, gtsam.Pose2(*pose))
    cauchy = gtsam.noiseModel.mEstimator.Cauchy.Create(1.5)

    def noise(full, yaw):
        turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        return gtsam.noiseModel.Gaussian.Covariance(turn @ full @ turn.T)

    step = np.diag([0.03**2, 0.03**2, 0.015**2])
    for k, m in enumerate(motions):
        graph.add(gtsam.BetweenFactorPose2(k, k + 1, gtsam.Pose2(*m), noise(step, m[2])))
    for k, j, z, full in zip(seen.pose_index, seen.landmark, seen.xyyaw, seen.cov, strict=True):
        soft = gtsam.noiseModel.Robust.Create(cauchy, noise(full, z[2]))
        graph.add(gtsam.BetweenFactorPose2(int(k), 12 + int(j), gtsam.Pose2(*z), soft))
    soft = gtsam.noiseModel.Robust.Create(cauchy, noise(cov[0], at[0, 2]))
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*at[0]), soft))
    loose = gtsam.noiseModel.Diagonal.Sigmas(np.array([2.0, 2.0, 1.0]))
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), loose))
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-12)
    result = gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()
    marginals = gtsam.Marginals(graph, result)

    for k in range(12):
        pose = result.atPose2(k)
        np.testing.assert_allclose(found[k, :2], [pose.x(), pose.y()], atol=2e-3)
        body = marginals.marginalCovariance(k)
        assert np.trace(spread[k, :2, :2]) == pytest.approx(np.trace(body[:2, :2]), rel=0.02)
