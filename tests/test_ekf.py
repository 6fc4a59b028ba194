"""The extended Kalman filter: its steps against an oracle, its consistency against chance."""

from dataclasses import replace

import numpy as np
import pytest
from ekf_world import EXACT, PLACES, START_COV, world
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.nees import nees
from slamreplay.errors import UsageError
from slamreplay.estimators import kalman
from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.consensus import locate, window_of
from slamreplay.estimators.ekf.filter import filtered, gates_of
from slamreplay.estimators.ekf.motion import Motion
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.observations import cartesian
from slamreplay.estimators.start import Start
from slamreplay.geometry import se2

GATES = gates_of(0.999)
WIDE = gates_of(1.0 - 1e-12)
LASTING = replace(EXACT, lasting_range_per_m=0.06, lasting_bearing_rad=0.02)


def covariance(rng, n):
    A = rng.standard_normal((n, n))
    return A @ A.T + 0.1 * np.eye(n)


def squares(out):
    """NIS of every sighting that was used."""
    used = out.status != kernels.UNUSED
    r, S = out.residual[used, :2], out.S[used, :2, :2]
    return np.einsum("ni,ni->n", r, np.linalg.solve(S, r[:, :, None])[:, :, 0])


@pytest.mark.parametrize("seed", range(5))
def test_prediction_equals_the_linear_step_with_numerical_jacobians(seed):
    rng = np.random.default_rng(seed)
    x, step = rng.normal(0.0, 1.0, 5), rng.normal(0.0, 1.0, 3)
    P, Q = covariance(rng, 5), covariance(rng, 3)

    def moved(pose, motion):
        return se2.compose(pose, motion)

    h = 1e-6
    F, G = np.eye(5), np.zeros((5, 3))
    for i in range(3):
        e = h * np.eye(3)[i]
        F[:3, i] = se2.wrap_angle(moved(x[:3] + e, step) - moved(x[:3] - e, step)) / (2 * h)
        # The increment's covariance is about the axes of the base before it.
        G[:3, i] = se2.wrap_angle(moved(x[:3], step + e) - moved(x[:3], step - e)) / (2 * h)
    _, expected = kalman.predict(x, P, np.zeros(5), G @ Q @ G.T, F)
    pose = moved(x[:3], step)
    kernels.predict(x, P, step, Q)

    np.testing.assert_allclose(x[:3], pose, atol=1e-12)
    np.testing.assert_allclose(P, expected, atol=1e-7)
    np.testing.assert_allclose(P, P.T, atol=1e-12)


@pytest.mark.parametrize("m", [2, 3])
@pytest.mark.parametrize("slot", [0, 3, 5])
def test_correction_equals_the_kalman_filter_and_its_derivatives_the_numbers(m, slot):
    rng = np.random.default_rng(7 * m + slot)
    n = 3 if slot == 0 else 7
    x, P, R = rng.normal(0.0, 0.1, n), covariance(rng, n), np.zeros((3, 3))
    R[:m, :m] = covariance(rng, m)
    place, residual = np.array([3.0, -2.0, 0.7]), rng.normal(0.0, 0.1, m)
    H, expected = np.zeros((3, n)), np.zeros(3)

    def seen(state):
        out, unused = np.zeros(3), np.zeros((3, n))
        kernels.measurement(state, place, slot, m, unused, out)
        return out

    kernels.measurement(x, place, slot, m, H, expected)
    for i in range(n):
        e = 1e-6 * np.eye(n)[i]
        np.testing.assert_allclose(H[:, i], (seen(x + e) - seen(x - e)) / 2e-6, atol=1e-8)
    oracle = kalman.correct(x, P, residual, H[:m], R[:m, :m])
    HP, S, L = np.zeros((3, n)), np.zeros((3, 3)), np.zeros((3, 3))
    kernels.innovate(P, H, R, m, HP, S)
    assert kernels.lower(S, m, L)
    nis = kernels.squared(L, residual, m)
    kernels.correct(x, P, H, R, m, HP, L, residual)

    np.testing.assert_allclose(S[:m, :m], oracle.S)
    np.testing.assert_allclose(nis, residual @ np.linalg.solve(oracle.S, residual))
    np.testing.assert_allclose(x[:3], [*oracle.x[:2], se2.wrap_angle(oracle.x[2])], atol=1e-12)
    np.testing.assert_allclose(x[3:], oracle.x[3:], atol=1e-12)
    np.testing.assert_allclose(P, oracle.P, atol=1e-12)


def test_noise_of_motion_does_not_depend_on_how_often_odometry_is_sampled():
    """A straight way of 3 m: lateral variance q d^2 / 3, and the same in one step as in sixty."""
    noise = Noise(position_per_metre=0.0, heading_per_metre=0.1)
    for n in (2, 61):
        t_ns = np.linspace(0, 900_000_000, n).astype(np.int64)
        xyyaw = np.column_stack([np.linspace(0.0, 3.0, n), np.zeros(n), np.zeros(n)])
        xyyaw = se2.compose([1.0, 2.0, 0.7], xyyaw)
        track = PoseTrack.without_covariance("odom", "base", t_ns, xyyaw)
        steps = Motion(track, noise).steps(t_ns[[0, -1]], noise)

        q = 0.01 * 3.0
        expected = [[0, 0, 0], [0, q * 9.0 / 3.0, q * 3.0 / 2.0], [0, q * 3.0 / 2.0, q]]
        np.testing.assert_allclose(steps.xyyaw[1], [3.0, 0.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(steps.Q[1], expected, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(1, 398), min_size=1, max_size=6, unique=True))
def test_prediction_over_any_stops_on_the_way_is_the_same(stops):
    evidence, _ = world(0, seconds=20.0)
    track = evidence.odometry
    ends = [0, len(track) - 1]
    found = []
    for rows in (ends, sorted({*ends, *stops})):
        steps = Motion(track, Noise()).steps(track.t_ns[rows], Noise())
        x, P = np.array([1.0, 2.0, 0.5]), np.zeros((3, 3))
        for step, Q in zip(steps.xyyaw[1:], steps.Q[1:], strict=True):
            kernels.predict(x, P, step, Q)
        found.append((x, P))

    np.testing.assert_allclose(found[0][0], found[1][0], atol=1e-9)
    np.testing.assert_allclose(found[0][1], found[1][1], atol=1e-9)


def test_other_sizes_of_wheels_bend_the_path():
    evidence, _ = world(0, seconds=10.0)
    track = evidence.odometry
    noise = Noise(distance_ratio=1.1, turn_ratio=0.9, turn_per_metre=0.2)
    told, bent = (Motion(track, n).steps(track.t_ns, n).xyyaw for n in (Noise(), noise))

    length = np.hypot(*told[:, :2].T)
    np.testing.assert_allclose(np.hypot(*bent[:, :2].T), 1.1 * length, rtol=1e-6)
    np.testing.assert_allclose(bent[:, 2], 0.9 * told[:, 2] + 0.22 * length, atol=1e-6)


@pytest.mark.parametrize("noise", [EXACT, LASTING], ids=["white", "lasting"])
def test_consistent_noise_gives_nees_and_nis_within_their_intervals(noise):
    runs = 40
    last, nis, reached = [], [], []
    for seed in range(runs):
        evidence, truth = world(seed, noise)
        out = filtered(evidence, noise, WIDE)
        e = out.xyyaw[-1] - truth[-1]
        e[2] = se2.wrap_angle(e[2])
        last.append(e @ np.linalg.solve(out.cov[-1], e))
        nis.append(squares(out).mean())
        reached.append(len(squares(out)))
    low, high = chi2.ppf([0.005, 0.995], 3 * runs) / runs
    assert low < np.mean(last) < high
    spread = 2.0 * np.sqrt(1.0 / np.sum(reached))  # of a mean of squares with 2 dof
    assert abs(np.mean(nis) - 2.0) < 4.0 * spread


def test_one_long_log_is_consistent_and_half_the_noise_told_is_four_times_too_sure():
    """Both against the interval of the mean for its effective number of samples."""
    evidence, truth = world(3, seconds=600.0)
    reference = PoseTrack.without_covariance("map", "base_link", evidence.row_ns, truth)

    def summary(process, measurement):
        out = filtered(evidence, EXACT, WIDE, process, measurement)
        track = PoseTrack("map", "base_link", evidence.row_ns, out.xyyaw, out.cov)
        return nees(track, reference).summary(), squares(out).mean()

    (plain, nis), (sure, sure_nis) = summary(1.0, 1.0), summary(0.25, 0.25)
    assert plain.credibility == "consistent"
    assert plain.test.n_eff > 50
    assert nis == pytest.approx(2.0, rel=0.05)
    assert sure.credibility == "overconfident"
    assert sure.test.mean / plain.test.mean == pytest.approx(4.0, rel=0.1)
    assert sure_nis / nis == pytest.approx(4.0, rel=0.02)


def test_errors_that_last_make_a_filter_that_thinks_them_white_too_sure():
    errors = []
    told = replace(EXACT, range_per_m=0.07, bearing_rad=0.03)  # as wide, but white
    for seed in range(20):
        evidence, truth = world(seed, LASTING)
        out = filtered(evidence, told, GATES)
        e = out.xyyaw[-1] - truth[-1]
        e[2] = se2.wrap_angle(e[2])
        errors.append(e @ np.linalg.solve(out.cov[-1], e))
    assert np.mean(errors) > 5.0


def test_wrong_names_are_rejected_and_right_ones_are_not():
    evidence, truth = world(1, wrong=0.1)
    out = filtered(evidence, EXACT, GATES)
    plain = world(1)[0].observations

    wrong = evidence.observations.thing != plain.thing
    assert (out.status[wrong] == kernels.REJECTED).mean() > 0.95
    assert (out.status[~wrong] == kernels.ACCEPTED).mean() > 0.98
    assert np.hypot(*(out.xyyaw - truth)[200:, :2].T).max() < 0.2


def test_it_starts_from_sightings_alone_though_some_names_are_wrong():
    within = 0
    for seed in range(20):
        evidence, truth = world(seed, wrong=0.15, seconds=20.0)
        evidence.given[0] = Start(0, None, START_COV)
        out = filtered(evidence, EXACT, GATES)
        first = int(np.argmax(np.isfinite(out.xyyaw[:, 0])))
        e = out.xyyaw[first] - truth[first]
        e[2] = se2.wrap_angle(e[2])
        within += e @ np.linalg.solve(out.cov[first], e) < chi2.ppf(0.999, 3)
        assert first < 100
        assert np.hypot(*e[:2]) < 0.5
    assert within >= 19


def of_polar(polar, dims, R, *more):
    """A window of ranges, bearings and headings."""
    seen, cov = cartesian(polar, R)
    return window_of(seen, dims, cov, *more)


def test_one_thing_alone_tells_no_pose():
    evidence, truth = world(2, seconds=10.0)
    seen = evidence.observations
    rows = np.arange(4)
    one = seen.thing[rows] == seen.thing[rows][0]
    R, still = seen.covariance(Noise())[rows], np.zeros((4, 3))
    whole = of_polar(seen.sensed[rows], seen.dims[rows], R, PLACES[seen.thing[rows]],
                     seen.thing[rows], still, np.zeros((4, 3, 3)))  # fmt: skip
    alone = of_polar(seen.sensed[:1].repeat(4, 0), seen.dims[rows], R,
                     PLACES[seen.thing[:1].repeat(4)], seen.thing[:1].repeat(4), still,
                     np.zeros((4, 3, 3)))  # fmt: skip

    pose, cov = locate(whole)
    assert one.sum() < 4
    assert np.hypot(*(pose - truth[0])[:2]) < 0.2
    assert np.linalg.eigvalsh(cov)[0] > 0.0
    assert locate(alone) is None  # it may be seen from anywhere around it


def test_a_window_is_brought_to_the_last_base_with_the_noise_of_the_way():
    """Against a Monte Carlo of noisy increments and noisy sightings."""
    rng = np.random.default_rng(0)
    steps = np.array([[0.0, 0.0, 0.0], [0.5, 0.1, 0.4], [0.6, 0.0, -0.9]])
    Q = np.array([np.zeros((3, 3)), np.diag([4e-4, 1e-4, 9e-4]), np.diag([1e-4, 4e-4, 4e-4])])
    polar = np.array([[3.0, 0.5, 0.2], [2.0, -0.4, 0.1], [4.0, 0.2, -0.3]])
    R = np.diag([4e-4, 1e-4, 4e-4])
    dims = np.full(3, 3)

    def points(p, s):
        w = of_polar(p, dims, np.stack([R] * 3), np.zeros((3, 3)), np.arange(3), s, Q)
        return np.column_stack([w.points, w.headings]), w.cov

    mean, cov = points(polar, steps)
    draws = []
    for _ in range(4000):
        s = steps + np.array([rng.multivariate_normal(np.zeros(3), q) for q in Q])
        draws.append(points(polar + rng.multivariate_normal(np.zeros(3), R, 3), s)[0] - mean)
    draws = np.array(draws)
    for k in range(3):
        found = draws[:, k].T @ draws[:, k] / len(draws)
        np.testing.assert_allclose(found, cov[k], atol=0.1 * np.abs(cov[k]).max())


def test_noise_that_makes_no_sense_is_refused():
    for values in ({"range_m": -1.0}, {"bearing_rad": 0.0}, {"range_m": 0.0, "range_per_m": 0.0},
                   {"turn_ratio": np.nan}):  # fmt: skip
        with pytest.raises(UsageError, match="ekf"):
            Noise(**values)
    assert Noise(bearing_offset_rad=-0.1).bearing_offset_rad == -0.1


def test_where_the_sensor_sits_is_not_known_better_for_looking_longer():
    evidence, _ = world(0)
    exact = filtered(evidence, EXACT, GATES)
    mounted = filtered(evidence, replace(EXACT, mount_m=0.03, mount_rad=0.02), GATES)

    np.testing.assert_array_equal(mounted.xyyaw, exact.xyyaw)
    extra = np.broadcast_to(np.diag([9e-4, 9e-4, 4e-4]), exact.cov.shape)
    np.testing.assert_allclose(mounted.cov - exact.cov, extra, atol=1e-12)


def test_no_pose_is_taken_where_another_one_explains_as_many_sightings():
    """Three things as seen from X, and from Y the third of them with two others."""
    places = np.array([[3.0, 1.0], [3.0, -2.0], [4.0, 0.5], [1.0, 3.0], [-1.0, 2.0]])
    X = np.array([0.3, -0.2, 0.4])
    turn = np.array([*places[2], 1.9])  # about the third thing, which looks the same from both
    Y = se2.compose(turn, se2.compose([*-places[2], 0.0], X))
    poses = np.array([X, X, X, Y, Y])
    seen = se2.between(poses, np.column_stack([places, np.zeros(5)]))[:, :2]
    polar = np.column_stack([np.hypot(*seen.T), np.arctan2(seen[:, 1], seen[:, 0]), np.zeros(5)])
    at = np.column_stack([places, np.full(5, np.nan)])
    R, still = np.tile(np.diag([4e-4, 1e-4, 1.0]), (5, 1, 1)), np.zeros((5, 3))
    Q = np.zeros((5, 3, 3))

    def found(rows):
        dims = np.full(len(rows), 2)
        return locate(of_polar(polar[rows], dims, R[rows], at[rows], rows, still[rows], Q[rows]))

    np.testing.assert_allclose(found(np.array([0, 1, 2]))[0], X, atol=1e-6)
    np.testing.assert_allclose(found(np.array([2, 3, 4]))[0], Y, atol=1e-6)
    assert found(np.arange(5)) is None


def test_a_start_from_errors_that_last_is_less_certain():
    evidence, _ = world(0, seconds=20.0)
    evidence = replace(evidence, given=[Start(0, None, START_COV)])
    ranges, bearings = (replace(EXACT, **{k: 0.1}) for k in ("lasting_range_per_m",
                                                             "lasting_bearing_rad"))  # fmt: skip
    white, *lasting = (filtered(evidence, n, GATES) for n in (EXACT, ranges, bearings))
    row = int(np.argmax(np.isfinite(white.xyyaw[:, 0])))
    for out in lasting:
        assert np.trace(out.cov[row]) > 1.3 * np.trace(white.cov[row])
