"""The replay of robot_localization's node: its filter, its parameters, its ways to take inputs."""

import numpy as np
import pytest
from scipy.stats import chi2

from slamreplay.bundle.manifest import Role
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.estimators import kalman
from slamreplay.estimators.ekf.estimator import MEASUREMENT_NOISE, PROCESS_NOISE, Ekf
from slamreplay.estimators.ekf.kernels import ACCEPTED, REJECTED
from slamreplay.estimators.ekf.node import kernels
from slamreplay.estimators.ekf.node.measurements import parts_of
from slamreplay.estimators.ekf.node.parameters import PLANAR, node_parameters
from slamreplay.estimators.start import GLOBAL, OFFSET
from slamreplay.geometry import se2
from slamreplay.replay.parameters import configured, read_parameters
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path
from slamreplay.testing.synthetic_rows import pose_columns, table_of, tf_rows

VELOCITIES = [False] * 6 + [True, True, False, False, False, True] + [False] * 3
POSE = [True, True, False, False, False, True] + [False] * 9
TURN = [False] * 11 + [True] + [False] * 3
HEADING = [False] * 5 + [True] + [False] * 9
ODOM = {"odom0": "/odom", "odom0_config": VELOCITIES}
Q = np.diag([0.01, 0.01, 0.01, 0.02, 0.02, 0.04, 0.02, 0.02])


def moved(x, dt):
    """The omnidirectional model, written down once more."""
    c, s = np.cos(x[2]), np.sin(x[2])
    u, v = x[3] * dt + x[6] * dt**2 / 2, x[4] * dt + x[7] * dt**2 / 2
    step = [c * u - s * v, s * u + c * v, x[5] * dt, x[6] * dt, x[7] * dt, 0.0, 0.0, 0.0]
    return x + np.array(step)


@pytest.mark.parametrize("scales", [False, True])
def test_prediction_equals_the_linear_step_with_numerical_jacobians(scales):
    rng = np.random.default_rng(0)
    x, A, dt = rng.normal(0.0, 1.0, 8), rng.standard_normal((8, 8)), 0.3
    P = A @ A.T
    F = np.column_stack([(moved(x + e, dt) - moved(x - e, dt)) / 2e-6 for e in 1e-6 * np.eye(8)])
    noise = Q.copy()
    noise[:3, :3] *= x[3:6] @ x[3:6] if scales else 1.0
    _, expected = kalman.predict(x, P, np.zeros(8), dt * noise, F)
    state = moved(x, dt)
    kernels.predict(x, P, dt, Q, scales)

    np.testing.assert_allclose(x, [*state[:2], se2.wrap_angle(state[2]), *state[3:]], atol=1e-12)
    np.testing.assert_allclose(P, expected, atol=1e-6)


def simulated(seed, K=300, dt=0.05):
    """A robot that moves by the model, and velocities and now and then a pose of it."""
    rng = np.random.default_rng(seed)
    x, truth = np.array([0.0, 0.0, 0.5, 0.4, 0.0, 0.2, 0.0, 0.0]), []
    R = np.diag([0.02, 0.02, 0.004, 0.01, 0.01, 0.005, 1.0, 1.0])
    z, used = np.zeros((K, 8)), np.zeros((K, 8), dtype=bool)
    for k in range(K):
        if k:
            x = moved(x, dt) + np.sqrt(dt) * rng.standard_normal(8) * np.sqrt(np.diag(Q))
        used[k, 3:6] = True
        used[k, :3] = k % 10 == 0
        z[k] = x + rng.standard_normal(8) * np.sqrt(np.diag(R))
        truth.append(x)
    z[:, 2] = se2.wrap_angle(z[:, 2])
    t_ns = (np.arange(K) * round(dt * 1e9)).astype(np.int64)
    return t_ns, z, np.tile(R, (K, 1, 1)), used, np.array(truth)


def ran(t_ns, z, R, used, threshold=np.inf, scale=1.0, lever=None):
    K = len(t_ns)
    x, P = np.zeros(8), np.zeros((8, 8))
    P[6, 6] = P[7, 7] = 1e-4
    out = (np.full((K, 3), np.nan), np.full((K, 3, 3), np.nan), np.full(K, np.nan),
           np.full((K, 8), np.nan), np.full((K, 8, 8), np.nan), np.zeros(K, dtype=np.int64),
           np.full((K, 3), np.nan))  # fmt: skip
    order = np.repeat(np.arange(K), 2)
    first = np.tile([True, False], K)
    kernels.run(np.repeat(t_ns, 2), np.where(first, order, -1), np.where(first, -1, order), z,
                scale * R, used, np.zeros((K, 2)) if lever is None else lever,
                np.full(K, threshold), scale * Q, bool(0), x, P, np.int64(-1), *out)  # fmt: skip
    return out


def test_the_loop_equals_a_kalman_filter_step_by_step():
    t_ns, z, R, used, _ = simulated(1, K=60)
    xyyaw, cov, _, residual, S, _, moves = ran(t_ns, z, R, used)
    x, P = np.where(used[0], z[0], 0.0), np.zeros((8, 8))
    P[:6, :6], P[6, 6], P[7, 7] = R[0, :6, :6], 1e-4, 1e-4
    for k in range(1, 60):
        F = np.column_stack([(moved(x + e, 0.05) - moved(x - e, 0.05)) / 2e-6
                             for e in 1e-6 * np.eye(8)])  # fmt: skip
        P = F @ P @ F.T + 0.05 * Q
        x = moved(x, 0.05)
        i = np.flatnonzero(used[k])
        gap = z[k, i] - x[i]
        gap[i == 2] = se2.wrap_angle(gap[i == 2])
        done = kalman.correct(x, P, gap, np.eye(8)[i], R[k][np.ix_(i, i)])
        np.testing.assert_allclose(residual[k, : len(i)], done.innovation, atol=1e-7)
        np.testing.assert_allclose(S[k, : len(i), : len(i)], done.S, atol=1e-7)
        np.testing.assert_allclose(moves[k], (done.x - x)[:3], atol=1e-7)
        x, P = done.x, done.P
    np.testing.assert_allclose(xyyaw[-1], [*x[:2], se2.wrap_angle(x[2])], atol=1e-6)
    np.testing.assert_allclose(cov[-1], P[:3, :3], atol=1e-6)


def test_matched_noise_is_consistent_and_half_of_it_is_not():
    def mean_nees(scale, runs):
        total = 0.0
        for seed in range(runs):
            t_ns, z, R, used, truth = simulated(seed)
            xyyaw, cov, *_ = ran(t_ns, z, R, used, scale=scale)
            e = xyyaw[-1] - truth[-1, :3]
            e[2] = se2.wrap_angle(e[2])
            total += e @ np.linalg.solve(cov[-1], e)
        return total / runs

    low, high = chi2.ppf([0.025, 0.975], 3 * 60) / 60
    assert low < mean_nees(1.0, 60) < high
    assert mean_nees(0.25, 30) > chi2.ppf(0.975, 90) / 30


def test_beyond_the_threshold_nothing_moves():
    t_ns, z, R, used, truth = simulated(2)
    z[100, 3] += 30.0
    plain, gated = ran(t_ns, z, R, used), ran(t_ns, z, R, used, threshold=5.0)

    assert gated[5][100] == REJECTED
    assert (gated[5][1:] == ACCEPTED).mean() > 0.98
    np.testing.assert_array_equal(gated[6][100], 0.0)
    assert np.hypot(*(gated[0] - truth[:, :3])[101, :2]) < 0.3
    assert np.hypot(*plain[6][100, :2]) > 0.1


def test_a_velocity_beside_the_base_is_freed_of_the_turn():
    """A sensor at (1, 2) of a robot that turns at 1 rad/s moves by (-2, 1) m/s."""
    n = 40
    z, used = np.zeros((n, 8)), np.zeros((n, 8), dtype=bool)
    z[:, 3], z[:, 4], z[:, 5], used[:, 3:6] = -2.0, 1.0, 1.0, True
    R, t_ns = np.tile(1e-4 * np.eye(8), (n, 1, 1)), np.arange(n, dtype=np.int64) * 100_000_000
    z[0, 3:5] = 0.0  # the start takes what it gets
    xyyaw = ran(t_ns, z, R, used, lever=np.tile([1.0, 2.0], (n, 1)))[0]

    np.testing.assert_allclose(xyyaw[-1], [0.0, 0.0, 3.9 - 2.0 * np.pi], atol=0.02)


def test_parameters_of_a_file_by_their_names():
    given = ODOM | {
        "two_d_mode": True,
        "world_frame": "/map",
        "imu0": "imu/data",
        "imu0_config": TURN,
        "imu0_relative": True,
        "imu0_differential": True,
        "imu0_angular_velocity_rejection_threshold": 3,
        "odom0_pose_rejection_threshold": 5.0,
        "process_noise_covariance": np.diag(np.arange(1.0, 16.0)).ravel().tolist(),
        "initial_estimate_covariance": [0.5] * 15,
    }
    found = node_parameters(given)
    odom, imu = found.inputs[1], found.inputs[0]

    assert (found.world_frame, found.map_frame, found.base_frame) == ("map", "map", None)
    assert (imu.topic, imu.differential, imu.relative) == ("imu/data", True, False)
    assert (imu.twist_threshold, odom.pose_threshold, odom.twist_threshold) == (3.0, 5.0, None)
    np.testing.assert_array_equal(np.diag(np.reshape(found.process_noise, (8, 8))), PLANAR + 1.0)
    np.testing.assert_array_equal(np.reshape(found.initial_covariance, (8, 8)), 0.5 * np.eye(8))
    default = node_parameters(ODOM)
    assert default.world_frame == "odom"
    np.testing.assert_array_equal(np.diag(np.reshape(default.process_noise, (8, 8)))[:3],
                                  [0.05, 0.05, 0.06])  # fmt: skip


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"odom0_cfg": True}, "odom0_config"),
        ({"two_d_mod": True}, "two_d_mode"),
        ({"odom0_config": [True] * 14}, "15 booleans"),
        ({"odom0_config": [1.0] * 15}, "15 booleans"),
        ({"odom0": 3}, "should be a text"),
        ({"odom0_relative": "yes"}, "true or false"),
        ({"odom0_twist_rejection_threshold": 0.0}, "above 0"),
        ({"odom0_rejection_threshold": 2.0}, "odom0_pose_rejection_threshold|odom0_twist_rej"),
        ({"process_noise_covariance": [1.0] * 16}, "225 or 15"),
        ({"process_noise_covariance": [-1.0] * 15}, "not positive"),
        ({"imu0_config": TURN}, "names no topic"),
    ],
)
def test_what_makes_no_sense_is_named(given, message):
    with pytest.raises(UsageError, match=message):
        Ekf.from_parameters(ODOM | given)


def test_without_inputs_the_parameters_are_those_of_this_filter():
    own = Ekf.from_parameters({"gate_probability": 0.99, "gyro_bias": 0.01, "range_m": 1})

    assert own.gate_probability == 0.99
    assert (own.noise.gyro_bias, own.noise.range_m, own.node) == (0.01, 1.0, None)
    for given, message in (
        ({"gyro_bia": 0.1}, "gyro_bias"),
        ({"gate_probability": 2.0}, "gate_probability"),
        ({"range_m": True}, "number"),
        ({"bearing_rad": -1.0}, "bearing_rad"),
    ):
        with pytest.raises(UsageError, match=message):
            Ekf.from_parameters(given)


def stated(variance, n):
    return np.tile((variance * np.eye(6)).ravel(), (n, 1))


def a_log(**odometry) -> Bundle:
    """The synthetic robot, whose odometry states its covariances."""
    log = synthetic_bundle(seconds=20.0)
    table = log.table("odometry")
    n = len(table)
    table = table.replace(
        **({"pose_covariance": stated(1e-3, n), "twist_covariance": stated(1e-3, n)} | odometry)
    )
    names = ("scans", "references", "transforms", "initial_poses", "poses")
    return Bundle(log.manifest, {n: log.table(n) for n in names} | {"odometry": table}, log.grids())


LOG = a_log()
QUIET = [0.0001] * 15  # a robot that drives round an ellipse hardly accelerates


def node(given):
    return Ekf.from_parameters({"process_noise_covariance": QUIET} | given)


def drift(estimate, from_row=5):
    """(N, 3) the way since a row, against the true one."""
    true = true_path((estimate.track.t_ns - START_NS) / 1e9)
    told = se2.between(estimate.track.xyyaw[from_row], estimate.track.xyyaw)
    return se2.between(se2.between(true[from_row], true), told)


def test_velocities_of_odometry_are_integrated_in_the_odom_frame():
    estimate = node(ODOM).run(LOG.view(), seed=0)
    (twist,) = estimate.innovations

    assert estimate.track.frame_id == "odom"
    assert np.hypot(*drift(estimate)[:, :2].T).max() < 0.5
    assert (twist.source, twist.frame_id, set(twist.about)) == (
        "odom0 twist",
        "base_link",
        {"/odom"},
    )
    assert twist.axes == ("vx m/s", "vy m/s", "vyaw rad/s")
    assert np.isfinite(twist.moved).all()
    assert estimate.scalars["odom0.messages"] == len(LOG.table("odometry"))


def test_absolute_relative_and_differential_poses():
    absolute, relative, differential = (
        node({"odom0": "odom", "odom0_config": POSE} | more).run(LOG.view(), seed=0)
        for more in ({}, {"odom0_relative": True}, {"odom0_differential": True})
    )
    assert [i.source for i in absolute.innovations] == ["odom0 pose"]
    assert [i.source for i in differential.innovations] == ["odom0 pose differences"]
    assert np.isnan(differential.track.xyyaw[0]).all()  # one pose alone is no velocity
    for one in (absolute, relative, differential):
        assert np.nanmax(np.hypot(*drift(one)[:, :2].T)) < 0.5
    np.testing.assert_allclose(relative.track.xyyaw[0], 0.0, atol=0.05)
    T = absolute.track.xyyaw[0]
    np.testing.assert_allclose(se2.compose(T, relative.track.xyyaw[-1])[:2],
                               absolute.track.xyyaw[-1, :2], atol=0.2)  # fmt: skip
    # Differences never tell where it is: only their covariance grows without a bound.
    assert differential.track.cov[-1, 0, 0] > 2.0 * absolute.track.cov[-1, 0, 0]


def test_a_localizers_pose_as_an_input_in_the_map_and_a_truth_never():
    given = ODOM | {"pose0": "/amcl_pose", "pose0_config": POSE, "world_frame": "map"}
    estimate = node(given).run(LOG.view(), seed=0)
    true = true_path((estimate.track.t_ns - START_NS) / 1e9)

    assert estimate.track.frame_id == "map"
    off = estimate.track.xyyaw - true
    assert np.hypot(*off[100:, :2].T).max() < 0.1
    assert {i.source for i in estimate.innovations} == {"pose0 pose", "odom0 twist"}
    lost = node({"odom0": "/odom", "odom0_config": VELOCITIES, "base_link_frame": "hull"})
    with pytest.raises(NotApplicableError, match=r"odom0 /odom.*tf leads to neither hull"):
        lost.run(LOG.view(), seed=0)
    judged = node({"pose0": "/truth", "pose0_config": POSE})
    with pytest.raises(NotApplicableError, match=r"pose0 /truth.*the log has .*/odom"):
        judged.run(LOG.view(), seed=0)


def with_imu(mount, **columns) -> Bundle:
    t_s = np.arange(0.0, 20.0, 0.02)
    yaw = np.unwrap(true_path(t_s)[:, 2])
    zero = np.zeros(len(t_s))
    rows = {
        "frame_id": "imu",
        "orientation_xyzw": pose_columns(np.column_stack([zero, zero, yaw]))["orientation_xyzw"],
        "orientation_covariance": np.tile((1e-4 * np.eye(3)).ravel(), (len(t_s), 1)),
        "angular_velocity_xyz": np.column_stack([zero, zero, np.gradient(yaw, t_s)]),
        "angular_velocity_covariance": np.tile((1e-6 * np.eye(3)).ravel(), (len(t_s), 1)),
        "linear_acceleration_xyz": np.column_stack([zero, zero, zero + 9.80665]),
        "linear_acceleration_covariance": np.tile((1e-2 * np.eye(3)).ravel(), (len(t_s), 1)),
    }
    tf = Table.concat(TABLES["transforms"], [LOG.table("transforms"), mount])
    names = ("scans", "references", "odometry", "initial_poses", "poses")
    tables = {n: LOG.table(n) for n in names} | {"transforms": tf}
    role = Role(role="imu", topic="/imu", type="synthetic", messages=len(t_s), reason="a test")
    manifest = LOG.manifest.model_copy(update={"roles": [*LOG.manifest.roles, role]})
    imu = table_of("imu", "/imu", t_s, **(rows | columns))
    return Bundle(manifest, tables | {"imu": imu}, LOG.grids())


def upside_down():
    """A mount turned by half a turn about x: its z axis points down."""
    edge = tf_rows("base_link", "imu", np.zeros(1), np.array([[0.1, 0.2, 0.0]]), is_static=True)
    return edge.replace(rotation_xyzw=np.array([[1.0, 0.0, 0.0, 0.0]]))


def test_an_inertial_unit_is_turned_into_the_base_and_its_heading_freed_of_the_mount():
    straight = tf_rows("base_link", "imu", np.zeros(1), np.array([[0.1, 0.2, 0.4]]), is_static=True)
    log = with_imu(straight)
    imu = {"imu0": "/imu", "imu0_config": TURN}
    seen = with_imu(upside_down(), angular_velocity_xyz=-log.table("imu")["angular_velocity_xyz"])
    for one in (log, seen):
        off = drift(node(ODOM | imu).run(one.view(), seed=0))[:, 2]
        assert np.abs(se2.wrap_angle(off)).max() < 0.02
    heading = node(ODOM | imu | {"imu0_config": HEADING}).run(log.view(), seed=0)
    true = true_path((heading.track.t_ns - START_NS) / 1e9)[:, 2]
    off = se2.wrap_angle(heading.track.xyyaw[20:, 2] - true[20:])
    np.testing.assert_allclose(off, -0.4, atol=0.05)
    relative = node(ODOM | imu | {"imu0_config": HEADING, "imu0_relative": True})
    assert abs(relative.run(log.view(), seed=0).track.xyyaw[0, 2]) < 0.05
    rates = node(ODOM | imu | {"imu0_config": HEADING, "imu0_differential": True})
    assert np.abs(se2.wrap_angle(drift(rates.run(log.view(), seed=0))[:, 2])).max() < 0.05


def test_gravity_is_taken_off_only_where_it_is_asked_for():
    tilt = tf_rows("base_link", "imu", np.zeros(1), np.zeros((1, 3)), is_static=True)
    half = 0.05
    lean = np.tile([0.0, np.sin(half), 0.0, np.cos(half)], (1000, 1))  # 0.1 rad about y
    felt = np.tile([-9.80665 * np.sin(0.1), 0.0, 9.80665 * np.cos(0.1)], (1000, 1))
    log = with_imu(tilt, orientation_xyzw=lean, linear_acceleration_xyz=felt)
    ask = {"imu0": "/imu", "imu0_config": [False] * 12 + [True, False, False]}
    for more, expected in ({"imu0_remove_gravitational_acceleration": True}, 0.0), ({}, 0.979):
        (one,), _ = parts_of(log.view(), node(ask | more).node)
        assert one.source == "imu0 acceleration"
        np.testing.assert_array_equal(np.flatnonzero(one.used.any(axis=0)), [6])
        np.testing.assert_allclose(np.abs(one.z[:, 6]), expected, atol=0.001)


def test_perturbations_reach_the_node_or_it_says_no():
    for name in (PROCESS_NOISE, MEASUREMENT_NOISE):
        plain = node(ODOM).run(LOG.view(), seed=0).track
        half = node(ODOM).run(LOG.view().with_setting(name, 0.5), seed=0).track
        assert not np.array_equal(plain.cov, half.cov)
    in_map = ODOM | {"world_frame": "map"}
    here, there = (node(in_map).run(v, seed=0).track.xyyaw[0]
                   for v in (LOG.view(), LOG.view().with_setting(OFFSET, 1.0)))  # fmt: skip
    assert np.hypot(*(there - here)[:2]) == pytest.approx(1.0, abs=0.05)
    for given, setting in ((ODOM, OFFSET), (ODOM, GLOBAL), (in_map, GLOBAL)):
        with pytest.raises(NotApplicableError):
            node(given).run(LOG.view().with_setting(setting, 1.0), seed=0)


ROS_2 = """
/robot/ekf_filter_node:
  ros__parameters:
    frequency: 30.0
    publish_tf: true
    two_d_mode: true
    odom0: /odom
    odom0_config: [false, false, false, false, false, false, true, true, false, false, false, true,
                   false, false, false]
    odom0_queue_size: 10
    use_control: false
"""
ROS_1 = """
ekf_se_odom:
  two_d_mode: true
  odom0: odom
  odom0_config: [false, false, false, false, false, false, true, true, false, false, false, true,
                 false, false, false]
  odom0_nodelay: true
"""


@pytest.mark.parametrize(("text", "live"), [(ROS_2, 4), (ROS_1, 1)])
def test_files_of_both_ros_are_read_and_what_has_no_part_in_a_replay_is_told(text, live, tmp_path):
    (tmp_path / "ekf.yaml").write_text(text, encoding="utf-8")
    found = read_parameters([tmp_path / "ekf.yaml"], ["ekf", "dead_reckoning"])
    made = configured("ekf", found.of["ekf"])

    assert f"{live} of the live node" in found.told[0]
    assert made.node.inputs[0].topic.strip("/") == "odom"
    assert made.node == node_parameters(ODOM | {"odom0": made.node.inputs[0].topic})
    (tmp_path / "ekf.yaml").write_text(
        text.replace("odom0_config", "odom0_cnfig"), encoding="utf-8"
    )
    with pytest.raises(UsageError, match="did you mean 'odom0_config'"):
        read_parameters([tmp_path / "ekf.yaml"], ["ekf"])
