"""A gyroscope beside the wheels: their turns held against each other, its bias found."""

from dataclasses import replace

import numpy as np
import pytest
from ekf_world import EXACT, START_COV, world
from scipy.stats import chi2

from slamreplay.bundle.manifest import Role
from slamreplay.bundle.run import Estimate
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.evidence.nees import nees
from slamreplay.estimators import kalman
from slamreplay.estimators.dead_reckoning import DeadReckoning
from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.estimator import Ekf
from slamreplay.estimators.ekf.filter import filtered, gates_of
from slamreplay.estimators.ekf.gyro import Gyro, gyro_of
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.observations import Observations
from slamreplay.geometry import se2
from slamreplay.replay.metrics import judging_reference
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path
from slamreplay.testing.synthetic_rows import table_of

WIDE = gates_of(1.0 - 1e-12)
#: Of the sensors alone: nothing for clocks and scales that are exact here.
TOLD = replace(
    EXACT, gyro_per_root_s=0.003, gyro_per_turn=0.0, gyro_clock_s=0.0, gyro_bias=0.003,
    wheel_turn=0.05,
)  # fmt: skip


def blind(seed, noise=TOLD, seconds=20.0):
    """A robot that sees nothing, with a gyroscope whose bias walks, and its true poses."""
    rng = np.random.default_rng(seed + 1000)
    wheels = 1.0 + noise.wheel_turn * rng.standard_normal()
    evidence, truth = world(seed, replace(noise, turn_ratio=wheels), seconds)
    dt = np.diff(evidence.row_ns) / 1e9
    walk = noise.gyro_bias_per_root_s * np.sqrt(dt) * rng.standard_normal(len(dt))
    bias = noise.gyro_bias * rng.standard_normal() + np.cumsum(walk)
    white = noise.gyro_per_root_s * np.sqrt(dt) * rng.standard_normal(len(dt))
    step = se2.wrap_angle(np.diff(truth[:, 2])) + bias * dt + white
    turn, zero = np.append(0.0, np.cumsum(step)), np.zeros(len(truth))
    unknown, gaps = np.full(len(truth), np.nan), np.zeros(len(truth), dtype=np.int64)
    gyro = Gyro(evidence.row_ns, turn, zero, unknown, gaps)
    return replace(evidence, observations=Observations.none(), gyro=gyro), truth, bias


def last_nees(out, truth):
    e = out.xyyaw[-1] - truth[-1]
    e[2] = se2.wrap_angle(e[2])
    return e @ np.linalg.solve(out.cov[-1], e)


@pytest.mark.parametrize("seed", range(3))
def test_the_turn_equals_a_kalman_filter_that_has_the_noise_of_the_step_in_its_state(seed):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((5, 5))
    P, B = A @ A.T + 0.1 * np.eye(5), rng.standard_normal((3, 3))
    Q, x = 0.1 * B @ B.T, rng.normal(0.0, 0.3, 5)
    x[3] = 0.0  # what wheels lack turns the way to first order only
    step, dt, turned, variance = np.array([0.4, 0.1, 0.3]), 0.2, 0.25, 0.01

    def moved(state):
        """The step with its turn longer by the share of it that wheels lack."""
        lack = state[3] * step[2]
        c, s = np.cos(state[2]), np.sin(state[2])
        way = np.array([c * step[0] - s * step[1], s * step[0] + c * step[1]])
        left = np.array([-way[1], way[0]])
        return np.append(state[:2] + way + 0.5 * lack * left, [state[2] + step[2] + lack,
                                                               *state[3:]])  # fmt: skip

    F = np.column_stack([(moved(x + e) - moved(x - e)) / 2e-6 for e in 1e-6 * np.eye(5)])
    cos, sin = np.cos(x[2]), np.sin(x[2])
    G = np.zeros((5, 3))
    G[:3, :3] = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]
    P_prior = F @ P @ F.T + G @ Q @ G.T
    whole = np.block([[P_prior, G @ Q], [Q @ G.T, Q]])  # state, and noise of this step
    H = np.array([[0.0, 0.0, 0.0, step[2], dt, 0.0, 0.0, 1.0]])
    gap = np.array([turned - (1.0 + x[3]) * step[2] - x[4] * dt])
    oracle = kalman.correct(np.append(moved(x), np.zeros(3)), whole, gap, H, [[variance]])

    yaw, out = x[2], np.zeros(2)
    kernels.predict(x, P, step, Q)
    kernels.scale_turn(x, P, yaw, step)
    status = kernels.turn_by_gyro(x, P, yaw, step, Q, turned, variance, dt, 1e9, out)
    assert status == kernels.ACCEPTED
    np.testing.assert_allclose(x, oracle.x[:5], atol=1e-7)
    np.testing.assert_allclose(P, oracle.P[:5, :5], atol=1e-6)
    np.testing.assert_allclose(out, [-gap[0], oracle.S[0, 0]], atol=1e-6)


def test_consistent_noise_gives_nees_and_nis_within_their_intervals():
    runs, last, nis = 100, [], []
    for seed in range(runs):
        evidence, truth, _ = blind(seed)
        out = filtered(evidence, TOLD, WIDE)
        last.append(last_nees(out, truth))
        used = out.turned.status != kernels.UNUSED
        nis.append(np.mean(out.turned.residual[used, 0] ** 2 / out.turned.S[used, 0, 0]))
    low, high = chi2.ppf([0.025, 0.975], 3 * runs) / runs
    assert low < np.mean(last) < high
    assert np.mean(nis) == pytest.approx(1.0, abs=0.02)
    half = replace(TOLD, gyro_bias=0.0015, wheel_turn=0.025)
    sure = [last_nees(filtered(e, half, WIDE, 0.25), t)
            for e, t, _ in (blind(seed) for seed in range(20))]  # fmt: skip
    assert np.mean(sure) > chi2.ppf(0.975, 60) / 20


def test_a_robot_at_rest_learns_the_bias_and_keeps_its_heading_after():
    """Ten seconds at rest tell a bias of 2 deg/s to 0.001 rad/s: white noise over their root."""
    evidence, truth, _ = blind(5)
    rest_ns = np.arange(0, 10 * 10**9, 50_000_000)
    t_ns = np.concatenate([rest_ns, evidence.row_ns + 10 * 10**9])
    still = np.repeat(evidence.odometry.xyyaw[:1], len(rest_ns), axis=0)
    track = PoseTrack.without_covariance(
        "odom", "base_link", t_ns, np.concatenate([still, evidence.odometry.xyyaw])
    )
    turn = np.concatenate([np.zeros(len(rest_ns)), evidence.gyro.turn]) + 0.03 * t_ns / 1e9
    unknown, zero = np.full(len(t_ns), np.nan), np.zeros(len(t_ns))
    gyro = Gyro(t_ns, turn, zero, unknown, zero.astype(np.int64))
    rested = replace(evidence, odometry=track, row_ns=t_ns, gyro=gyro)
    told = replace(TOLD, gyro_bias=0.03)
    out = filtered(rested, told, WIDE)
    alone = filtered(replace(rested, gyro=None), told, WIDE)
    restless = filtered(evidence, told, WIDE)

    assert out.turns[1] == pytest.approx(0.03, abs=0.005)
    grown, wheels, turning = (o.cov[-1, 2, 2] - START_COV[2, 2] for o in (out, alone, restless))
    assert grown < 0.1 * wheels
    assert turning > 0.8 * wheels  # whoever always turns never sees a zero
    assert abs(se2.wrap_angle(out.xyyaw[-1, 2] - truth[-1, 2])) < 3.0 * out.cov[-1, 2, 2] ** 0.5
    assert np.isnan(alone.turns).all()


def test_wheels_that_tell_every_turn_too_large_are_found_out():
    """Skid steering: half of what the wheels say. Without the gyroscope the heading is lost."""
    half = replace(TOLD, turn_ratio=0.5)
    evidence, truth = world(4, half, 60.0)
    turn = np.append(0.0, np.cumsum(se2.wrap_angle(np.diff(truth[:, 2]))))
    zero, gaps = np.zeros(len(truth)), np.zeros(len(truth), dtype=np.int64)
    gyro = Gyro(evidence.row_ns, turn, zero, np.full(len(truth), np.nan), gaps)
    evidence = replace(evidence, observations=Observations.none(), gyro=gyro)
    out = filtered(evidence, replace(TOLD, wheel_turn=0.02), gates_of(0.999))
    alone = filtered(replace(evidence, gyro=None), TOLD, gates_of(0.999))

    assert out.turns[0] == pytest.approx(-0.5, abs=0.15)
    error = np.abs(se2.wrap_angle(out.xyyaw[:, 2] - truth[:, 2]))
    assert error.max() < 0.6
    assert np.abs(se2.wrap_angle(alone.xyyaw[:, 2] - truth[:, 2])).max() > 2.0


def test_wheels_that_slip_in_a_turn_are_not_believed():
    """For two seconds they say a turn of 0.4 rad/s that the robot does not make."""
    evidence, truth, _ = blind(1)
    path, lie = evidence.odometry.xyyaw.copy(), np.zeros(len(truth))
    lie[201:241] = 0.4 / 20
    slipped = np.zeros_like(path)
    for k in range(len(path) - 1):
        step = se2.between(path[k], path[k + 1])
        step[2] += lie[k + 1]
        slipped[k + 1] = se2.compose(slipped[k], step)
    odometry = replace(evidence.odometry, xyyaw=slipped)
    out = filtered(replace(evidence, odometry=odometry), TOLD, gates_of(0.999))
    alone = filtered(replace(evidence, odometry=odometry, gyro=None), TOLD, gates_of(0.999))

    during = (out.turned.t_ns >= evidence.row_ns[201]) & (out.turned.t_ns < evidence.row_ns[241])
    assert (out.turned.status[during] == kernels.REJECTED).mean() > 0.5
    assert (out.turned.status[~during] == kernels.REJECTED).mean() < 0.01
    turned = se2.wrap_angle(out.xyyaw[245, 2] - out.xyyaw[200, 2])
    true = se2.wrap_angle(truth[245, 2] - truth[200, 2])
    assert abs(se2.wrap_angle(turned - true)) < 0.1
    assert abs(se2.wrap_angle(alone.xyyaw[245, 2] - alone.xyyaw[200, 2] - true)) > 0.5


def with_imu(bundle: Bundle, **columns) -> Bundle:
    """A log whose robot has an inertial unit at 50 Hz, turned over: its z axis points down."""
    t_s = np.arange(0.0, (bundle.manifest.end_ns - START_NS) / 1e9, 0.02)
    yaw = np.unwrap(true_path(t_s)[:, 2])
    rate = np.gradient(yaw, t_s) + 0.01 * np.random.default_rng(0).standard_normal(len(t_s))
    rate += 0.0005
    zero = np.zeros(len(t_s))
    rows = {
        "frame_id": "imu",
        "orientation_xyzw": np.full((len(t_s), 4), np.nan),
        "orientation_covariance": np.full((len(t_s), 9), np.nan),
        "angular_velocity_xyz": np.column_stack([zero, zero, -rate]),
        "angular_velocity_covariance": np.full((len(t_s), 9), np.nan),
        "linear_acceleration_xyz": np.column_stack([zero, zero, zero - 9.8]),
        "linear_acceleration_covariance": np.full((len(t_s), 9), np.nan),
    }
    imu = table_of("imu", "/imu", t_s, **(rows | columns))
    role = Role(role="imu", topic="/imu", type="synthetic", messages=len(t_s), reason="a test")
    manifest = bundle.manifest.model_copy(update={"roles": [*bundle.manifest.roles, role]})
    tables = {n: bundle.table(n) for n in ("scans", "odometry", "references", "transforms",
                                           "initial_poses", "poses")}  # fmt: skip
    return Bundle(manifest, {**tables, "imu": imu}, bundle.grids())


LOG = synthetic_bundle(seconds=60.0)
#: This robot never rests, so that only what is known before tells how large a bias may be.
KNOWN = Ekf(Noise(gyro_bias=0.0005))


def worst_turn(estimate: Estimate) -> float:
    true = true_path((estimate.track.t_ns - START_NS) / 1e9)
    off = se2.between(true, estimate.track.xyyaw)[:, 2]
    return float(np.abs(se2.wrap_angle(off - off[0])).max())


def test_a_unit_of_unknown_mount_is_levelled_by_gravity_and_tells_the_heading():
    log = with_imu(LOG)
    estimate = KNOWN.run(log.view(), seed=0)
    plain = DeadReckoning().run(log.view(), seed=0)

    assert estimate.scalars["gyro_bias"] == pytest.approx(0.0005, abs=0.001)
    assert worst_turn(estimate) < 0.5 * worst_turn(plain)
    (turns,) = estimate.innovations
    assert (turns.source, turns.axes, turns.frame_id) == ("odometry", ("turn rad",), "base_link")
    assert set(turns.about) == {"odom"}
    assert turns.accepted.mean() > 0.99
    assert np.isfinite(turns.moved).all()
    held = nees(estimate.track, judging_reference(log))
    assert held.summary().test.mean < 3.0 * 1.5


def test_a_unit_that_nothing_levels_is_left_out_and_one_of_headings_alone_is_not():
    felt = with_imu(LOG).table("imu")["linear_acceleration_xyz"]
    floating = with_imu(LOG, linear_acceleration_xyz=np.zeros_like(felt))
    assert gyro_of(floating.view()) is None
    scalars = Ekf().run(floating.view(), seed=0).scalars
    assert ("gyro_bias" in scalars, scalars["imu_left_out"]) == (False, 1.0)

    t_s = np.arange(0.0, (LOG.manifest.end_ns - START_NS) / 1e9, 0.02)
    half = 0.5 * (true_path(t_s)[:, 2] - 1.0)
    zero = np.zeros(len(t_s))
    breathing = 1e-4 * (1.0 + 0.01 * np.sin(np.arange(len(t_s))))
    stated = breathing[:, None] * np.eye(3).ravel()
    headed = with_imu(
        LOG,
        angular_velocity_xyz=np.full((len(t_s), 3), np.nan),
        orientation_xyzw=np.column_stack([zero, zero, np.sin(half), np.cos(half)]),
        orientation_covariance=stated,
    )
    assert worst_turn(KNOWN.run(headed.view(), seed=0)) < 0.1
    silent = np.full((len(t_s), 9), np.nan)
    undeclared = replace_imu(headed, orientation_covariance=silent)
    assert gyro_of(undeclared) is None


def replace_imu(bundle, **columns):
    return bundle.view().with_table(bundle.table("imu").replace(**columns))


def test_a_gap_of_the_gyroscope_leaves_the_wheels_alone():
    imu = with_imu(LOG).table("imu")
    late = (imu.t_ns > START_NS + 20 * 10**9) & (imu.t_ns < START_NS + 30 * 10**9)
    view = with_imu(LOG).view().with_table(imu.take(~late))
    (turns,) = Ekf().run(view, seed=0).innovations

    seconds = (turns.t_ns - START_NS) / 1e9
    assert not ((seconds > 20.2) & (seconds < 29.9)).any()
    assert (seconds > 30.2).any()
