"""Dead reckoning and AMCL over a whole log."""

import numpy as np
import pytest

from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.estimators import ESTIMATORS
from slamreplay.estimators.amcl.estimator import PARTICLES, RANDOM_SEED, Amcl
from slamreplay.estimators.dead_reckoning import DeadReckoning
from slamreplay.estimators.start import GLOBAL, OFFSET, ROTATE, starts
from slamreplay.geometry import se2
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path

BUNDLE = synthetic_bundle(seconds=30.0)
TAGGED = synthetic_bundle(seconds=12.0, with_tags=True)
NO_START = synthetic_bundle(seconds=12.0, with_belief=False, with_initial_pose=False)


def error(track) -> np.ndarray:
    return se2.between(true_path((track.t_ns - START_NS) / 1e9), track.xyyaw)


def first_start(view: BundleView):
    scans = scan_set(view)
    return starts(view, scans.t_ns, scans.odometry.at(scans.t_ns).xyyaw)[0]


def test_amcl_follows_the_robot_and_dead_reckoning_drifts_from_it():
    amcl = Amcl().run(BUNDLE.view(), seed=1)
    dead = DeadReckoning().run(BUNDLE.view(), seed=1)

    assert amcl.track.frame_id == dead.track.frame_id == "map"
    assert len(amcl.track) == len(dead.track) == 300
    assert np.hypot(*error(amcl.track)[50:, :2].T).max() < 0.3
    assert np.hypot(*error(dead.track)[-1, :2]) > 0.15
    assert 0.1 < np.mean(amcl.diagnostics["updated"]) < 0.4
    assert (amcl.diagnostics["particles"] >= 500).all()
    assert (amcl.diagnostics["clusters"][50:] == 1).all()


def test_the_ledger_of_amcl_says_what_each_scan_wanted_and_what_it_did():
    amcl = Amcl().run(BUNDLE.view(), seed=1)
    (scan,) = amcl.innovations
    updated = amcl.diagnostics["updated"] == 1.0

    assert (scan.source, scan.frame_id, scan.axes) == ("scan", "map", ("x m", "y m", "yaw rad"))
    np.testing.assert_array_equal(scan.t_ns, amcl.track.t_ns[updated])
    assert not scan.is_predicted
    assert scan.accepted.all()
    assert (scan.score > 0.9).all()
    before = amcl.track.xyyaw[updated] - scan.moved
    wanted = before + scan.residual  # where the scan alone fits best
    off = wanted - true_path((scan.t_ns - START_NS) / 1e9)
    assert np.median(np.hypot(off[:, 0], off[:, 1])) < 0.03
    assert np.abs(se2.wrap_angle(off[:, 2])).max() < 0.02
    assert scan.nis[0] < 16.0

    ahead = Amcl().run(BUNDLE.view().with_setting(OFFSET, 0.3), seed=1).innovations[0]
    back = scan.residual[0] - ahead.residual[0]
    np.testing.assert_allclose(np.hypot(*back[:2]), 0.3, atol=0.05)
    without = Amcl(judge_scans=False).run(BUNDLE.view(), seed=1)
    assert without.innovations == ()
    np.testing.assert_array_equal(without.track.xyyaw, amcl.track.xyyaw)


def test_the_ledger_of_a_global_start_knows_no_prediction():
    (scan,) = Amcl().run(NO_START.view(), seed=1).innovations

    assert np.isnan(scan.residual[0]).all()
    assert np.isnan(scan.moved[0]).all()
    assert np.isfinite(scan.residual[1:]).all()


def test_the_ledger_of_dead_reckoning_has_steps_and_no_residual():
    dead = DeadReckoning().run(BUNDLE.view(), seed=1)
    (steps,) = dead.innovations

    assert (steps.source, steps.is_predicted) == ("odometry", False)
    assert np.isnan(steps.residual).all()
    np.testing.assert_allclose(
        np.diff(dead.track.xyyaw[:, :2], axis=0), steps.moved[:, :2], atol=1e-12
    )


def test_parameters_say_where_amcl_starts_and_a_perturbation_moves_that():
    pose = {"set_initial_pose": True, "initial_pose.x": 1.0, "initial_pose.y": -2.0}
    told = Amcl.from_parameters({**pose, "update_min_d": 100.0, "update_min_a": 100.0})
    log = synthetic_bundle(seconds=2.0, with_initial_pose=False)

    track = told.run(log.view(), seed=1).track
    moved = told.run(log.view().with_setting(OFFSET, 3.0), seed=1).track

    np.testing.assert_allclose(track.xyyaw[0, :2], [1.0, -2.0], atol=0.5)
    np.testing.assert_allclose(moved.xyyaw[0, :2] - track.xyyaw[0, :2], [3.0, 0.0], atol=0.5)


def test_the_pose_that_ros_1_keeps_counts_where_the_log_says_of_none():
    kept = Amcl.from_parameters({"initial_pose_x": 1.0, "initial_pose_y": -2.0, "update_min_d": 99})

    unknown, known = (kept.run(log.view(), seed=1).track for log in (NO_START, BUNDLE))

    np.testing.assert_allclose(unknown.xyyaw[0, :2], [1.0, -2.0], atol=0.5)
    assert np.hypot(*error(known)[0, :2]) < 0.3


def test_a_random_seed_of_the_parameters_replaces_that_of_the_trial():
    fixed = Amcl.from_parameters({"random_seed": 5})
    log = synthetic_bundle(seconds=2.0).view()

    tracks = [e.run(log, seed=s).track.xyyaw for e, s in ((fixed, 1), (fixed, 2), (Amcl(), 5))]

    np.testing.assert_array_equal(tracks[0], tracks[1])
    np.testing.assert_array_equal(tracks[0], tracks[2])
    other = fixed.run(log.with_setting(RANDOM_SEED, 1.0), seed=1).track.xyyaw
    assert not np.array_equal(other, tracks[0])


@pytest.mark.parametrize(("ratio", "most"), [(0.1, 200), (2.0, 4000)])
def test_the_number_of_particles_is_a_setting(ratio, most):
    log = synthetic_bundle(seconds=2.0).view().with_setting(PARTICLES, ratio)
    particles = Amcl().run(log, seed=1).diagnostics["particles"]

    assert particles.max() <= most
    assert particles.min() >= most / 4


@pytest.mark.parametrize("changed", [
    {"laser_model_type": "likelihood_field_prob"},
    {"laser_model_type": "beam"},
    {"robot_model_type": "nav2_amcl::OmniMotionModel"},
    {"resample_interval": 2},
    {"laser_model_type": "likelihood_field_prob", "do_beamskip": True},
])  # fmt: skip
def test_every_model_follows_the_robot(changed):
    amcl = Amcl.from_parameters(changed).run(TAGGED.view(), seed=1)

    assert np.hypot(*error(amcl.track)[60:, :2].T).max() < 0.3


def test_dead_reckoning_covers_its_own_error():
    track = DeadReckoning().run(BUNDLE.view(), seed=1).track

    e = (track.xyyaw - true_path((track.t_ns - START_NS) / 1e9))[-1]
    e[2] = se2.wrap_angle(e[2])
    assert e @ np.linalg.solve(track.cov[-1], e) < 12.0
    assert np.trace(track.cov[-1]) > np.trace(track.cov[0])


def test_dead_reckoning_covariance_equals_step_by_step_propagation():
    config = DeadReckoning(0.05, 0.03, 0.1)
    track = config.run(NO_START.view(), seed=0).track
    scans = scan_set(NO_START.view())
    path = scans.odometry

    P, before = np.zeros((3, 3)), path.xyyaw[0]
    for pose in path.xyyaw[path.t_ns <= track.t_ns[-1]][1:]:
        step = pose - before
        F = np.array([[1, 0, -step[1]], [0, 1, step[0]], [0, 0, 1]])
        length, turn = np.hypot(*step[:2]), abs(se2.wrap_angle(step[2]))
        noise = [0.05**2 * length] * 2 + [0.03**2 * length + 0.1**2 * turn]
        P, before = F @ P @ F.T + np.diag(noise), pose

    assert track.frame_id == "odom"
    np.testing.assert_allclose(track.cov[-1], P, rtol=1e-9, atol=1e-15)


def test_the_initial_pose_comes_before_the_belief_and_the_belief_before_anywhere():
    given = first_start(BUNDLE.view())
    believed = first_start(synthetic_bundle(seconds=5.0, with_initial_pose=False).view())

    assert np.abs(se2.between(true_path(np.zeros(1))[0], given.xyyaw)[:2]).min() > 0.05
    assert np.abs(se2.between(true_path(np.zeros(1))[0], believed.xyyaw)).max() < 0.05
    with pytest.raises(IndexError):
        first_start(NO_START.view())


def test_amcl_without_any_start_localizes_globally():
    estimate = Amcl().run(NO_START.view(), seed=1)

    assert np.sqrt(estimate.track.cov[0, 0, 0]) > 2.0
    assert np.isfinite(estimate.diagnostics["clusters"]).all()
    assert estimate.track.frame_id == "map"


def test_a_later_initial_pose_starts_amcl_again():
    poses = BUNDLE.table("initial_poses")
    late = poses.replace(**{t: poses[t] + 10_000_000_000 for t in ("t_ns", "t_log_ns")})
    both = Table.concat(poses.schema, [poses, late])
    estimate = Amcl().run(BUNDLE.view().with_table(both), seed=1)

    restarted = np.flatnonzero(estimate.diagnostics["updated"])
    assert 100 in restarted.tolist()  # the first scan after it arrived, whatever had moved
    assert np.hypot(*error(estimate.track)[100, :2]) > 0.8  # where somebody, wrongly, said it is


@pytest.mark.parametrize(
    "name", [name for name in ESTIMATORS if OFFSET in ESTIMATORS.load(name).settings]
)
def test_settings_shift_the_start(name):
    plain = first_start(TAGGED.view())
    view = TAGGED.view().with_setting(OFFSET, 1.0).with_setting(ROTATE, 0.5)

    moved = se2.between(plain.xyyaw, first_start(view).xyyaw)
    run = ESTIMATORS.load(name)().run(view, seed=1)

    np.testing.assert_allclose(moved, [1.0, 0.0, 0.5], atol=1e-12)
    assert np.hypot(*error(run.track)[0, :2]) > 0.4


def test_a_global_start_knows_nothing():
    assert first_start(BUNDLE.view().with_setting(GLOBAL, 1.0)).xyyaw is None
    cov = Amcl().run(BUNDLE.view().with_setting(GLOBAL, 1.0), seed=1).track.cov
    assert np.sqrt(cov[0, 0, 0]) > 2.0


@pytest.mark.parametrize("table", ["scans", "odometry"])
def test_what_is_missing_is_named(table):
    view = BUNDLE.view().with_table(Table.empty(BUNDLE.table(table).schema))
    view = view.with_table(Table.empty(BUNDLE.table("transforms").schema))

    with pytest.raises(NotApplicableError, match="scans" if table == "scans" else "odometry"):
        Amcl().run(view, seed=0)


def test_a_log_without_map_is_named():
    with pytest.raises(NotApplicableError, match="--map"):
        Amcl().run(synthetic_bundle(seconds=2.0, with_map=False).view(), seed=0)
