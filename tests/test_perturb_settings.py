"""Perturbations of settings: who declares one is changed by it, who does not refuses it."""

import numpy as np
import pytest

from slamreplay.bundle.run import Run, Trial, run_bytes
from slamreplay.bundle.tables import Table
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.estimators import ESTIMATORS, RECORDED
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.estimator import Amcl
from slamreplay.estimators.dead_reckoning import DeadReckoning
from slamreplay.estimators.start import MOVED, starts
from slamreplay.geometry import se2
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.one_trial import run_trial
from slamreplay.replay.reported import REPORTED
from slamreplay.testing.synthetic import synthetic_bundle

BUNDLE = synthetic_bundle(seconds=4.0, with_tags=True)

#: Levels that no estimator can overlook, by name and variant.
LEVELS = {
    "initial_pose.offset": 0.5,
    "initial_pose.aside": -0.5,
    "initial_pose.rotate": 90.0,
    "initial_pose.ambiguous": 0.5,
    "initial_pose.global": 1.0,
    "process_noise_scale.covariance": 9.0,
    "measurement_noise_scale.covariance": 9.0,
    "min_score.scale": 2.0,
    "particle_count.scale": 0.2,
    "pose_covariance_scale.covariance": 4.0,
}
#: What needs a lap, or a fit of its own each time: the estimators' own conformance shows these.
SLOW = {
    ("min_score.scale", "pose_graph"),
    ("min_score.scale", "pose_graph_online"),
    ("process_noise_scale.covariance", "pose_graph_online"),
    *((text, "ekf_tuned") for text in LEVELS if text.startswith(("initial", "measurement"))),
}


def perturbed(text: str, level: float, view=None, seed: int = 0):
    name, _, variant = text.partition(".")
    rng = np.random.Generator(np.random.PCG64(seed))
    return PERTURBATIONS.load(name)().apply(view or BUNDLE.view(), variant, level, rng)


def run(estimator: str, perturbation: str | None = None, level: float | None = None) -> Run:
    return run_trial(BUNDLE, Trial(BUNDLE.manifest.bundle_id, estimator, 1, perturbation, level))


def bits(run: Run) -> bytes:
    return run_bytes(Run(Trial("", "", 0), run.estimate))


def test_every_perturbation_of_a_setting_is_tried_here():
    settings = {
        f"{name}.{variant}"
        for name in PERTURBATIONS
        for variant in PERTURBATIONS.load(name).variants
        if not PERTURBATIONS.load(name).touches & {*_TABLES, "map"}
    }
    assert settings == set(LEVELS)


_TABLES = {"odometry", "transforms", "imu", "scans", "initial_poses", "references"}


@pytest.mark.parametrize("estimator", list(ESTIMATORS))
def test_a_setting_changes_who_declares_it_and_is_refused_by_who_does_not(estimator):
    plain = run(estimator)
    for text, level in LEVELS.items():
        wanted = set(perturbed(text, level).settings)
        honoured = wanted <= ESTIMATORS.load(estimator).settings | REPORTED
        if (text, estimator) in SLOW:
            continue

        trial = run(estimator, text, level)

        assert (trial.estimate is not None) == honoured, text
        assert bool(trial.not_applicable) != honoured, text
        if honoured:
            assert bits(trial) != bits(plain), text
        elif estimator in RECORDED:
            assert trial.not_applicable == "recorded, cannot be run again"
        else:
            assert "has no setting" in str(trial.not_applicable)


@pytest.mark.parametrize("estimator", ["amcl", "dead_reckoning", "ekf", "recorded"])
def test_the_baseline_of_a_setting_is_the_run_without_it(estimator):
    plain = bits(run(estimator))
    for text in LEVELS:
        name, _, variant = text.partition(".")
        baseline = PERTURBATIONS.load(name).variants[variant].baseline
        if estimator in RECORDED and name != "pose_covariance_scale":
            continue
        assert bits(run(estimator, text, baseline)) == plain


def test_a_scaled_covariance_changes_that_of_every_pose_and_nothing_else():
    for estimator in ("dead_reckoning", "recorded"):
        plain = run(estimator).estimate
        told = run(estimator, "pose_covariance_scale.covariance", 4.0).estimate

        np.testing.assert_array_equal(told.track.xyyaw, plain.track.xyyaw)
        np.testing.assert_array_equal(told.track.cov, 4.0 * plain.track.cov)
        one, two = told.innovations[0], plain.innovations[0]
        np.testing.assert_array_equal(one.moved, two.moved)


@pytest.mark.parametrize(
    ("name", "estimators"),
    [
        ("process_noise_scale", 8),
        ("measurement_noise_scale", 7),
        ("min_score", 2),
        ("particle_count", 1),
    ],
)
def test_so_many_estimators_have_the_setting(name, estimators):
    have = [e for e in ESTIMATORS if name in ESTIMATORS.load(e).settings]
    assert len(have) == estimators


def test_dead_reckoning_is_as_unsure_as_the_scale_of_its_noise_says():
    view = BUNDLE.view()
    plain = DeadReckoning().run(view, seed=0).track
    told = DeadReckoning().run(view.with_setting("process_noise_scale", 4.0), seed=0).track
    twice = DeadReckoning().told(2.0).run(view, seed=0).track

    np.testing.assert_array_equal(told.xyyaw, plain.xyyaw)
    np.testing.assert_allclose(told.cov, twice.cov)
    assert np.trace(told.cov[-1]) > np.trace(plain.cov[-1])


def test_amcl_is_told_variances_of_motion_and_of_the_laser():
    plain = AmclConfig()

    one = plain.scaled(4.0, 9.0)

    assert (one.alpha1, one.alpha4, one.sigma_hit) == pytest.approx((0.8, 0.8, 0.6))
    squared = AmclConfig(squared_motion_noise=True).scaled(4.0, 1.0)
    assert squared.alpha3 == pytest.approx(0.4)  # it is a standard deviation there
    assert plain.scaled(1.0, 1.0) is plain


def test_amcl_with_more_noise_of_motion_is_less_sure():
    view = BUNDLE.view()
    tight, loose = (
        Amcl().run(view.with_setting("process_noise_scale", scale), seed=1).track
        for scale in (0.01, 25.0)
    )
    assert np.trace(loose.cov[-1]) > 2.0 * np.trace(tight.cov[-1])


def first_start(view):
    t_ns = BUNDLE.table("scans").t_ns
    return starts(view, t_ns, np.zeros((len(t_ns), 3)))[0]


def test_a_start_can_be_moved_ahead_aside_and_round():
    plain = first_start(BUNDLE.view())
    for text, level, expected in (
        ("offset", 1.5, [1.5, 0.0, 0.0]),
        ("aside", -0.4, [0.0, -0.4, 0.0]),
        ("rotate", 180.0, [0.0, 0.0, -np.pi]),
    ):
        moved = first_start(perturbed(f"initial_pose.{text}", level))
        off = se2.between(plain.xyyaw, moved.xyyaw)
        np.testing.assert_allclose(off[:2], expected[:2], atol=1e-12)
        assert abs(se2.wrap_angle(off[2] - expected[2])) < 1e-9
        np.testing.assert_array_equal(moved.cov, plain.cov)


def test_an_ambiguous_start_is_told_as_unsure_as_it_is():
    plain = first_start(BUNDLE.view())
    off = []
    for seed in range(200):
        start = first_start(perturbed("initial_pose.ambiguous", 0.5, seed=seed))
        off.append(se2.between(plain.xyyaw, start.xyyaw))
        np.testing.assert_allclose(
            start.cov - plain.cov, np.diag([0.25, 0.25, np.radians(15.0) ** 2]), atol=1e-12
        )
    np.testing.assert_allclose(np.std(off, axis=0), [0.5, 0.5, np.radians(15.0)], rtol=0.2)

    near, far = (
        se2.between(plain.xyyaw, first_start(perturbed("initial_pose.ambiguous", v, seed=4)).xyyaw)
        for v in (0.5, 1.0)
    )
    np.testing.assert_allclose(far, 2.0 * near, atol=1e-9)  # the same start, farther off
    lost = first_start(perturbed("initial_pose.ambiguous", 50.0)).cov - plain.cov
    assert lost[2, 2] == pytest.approx(np.pi**2 / 3.0)  # any heading, and no more than that


def test_a_start_that_nobody_gave_cannot_be_moved():
    bare = synthetic_bundle(seconds=1.0, with_initial_pose=False, with_belief=False).view()
    for setting in MOVED:
        with pytest.raises(NotApplicableError, match="no start"):
            DeadReckoning().run(bare.with_setting(setting, 1.0), seed=0)


def test_changed_odometry_leaves_a_start_that_was_believed_where_it_is():
    """The first belief comes of map -> odom and odometry, of which only the latter is changed."""
    view = BUNDLE.view().with_table(Table.empty(BUNDLE.table("initial_poses").schema))
    late = BUNDLE.table("transforms")
    own = (late["child_frame"] != "odom") | (late["t_log_ns"] > late["t_log_ns"].min() + 10**9)
    plain = view.with_table(late.take(own))
    poses = BUNDLE.table("poses")
    plain = plain.with_table(Table.empty(poses.schema))
    bundle = plain.bundle
    bundle = type(bundle)(
        bundle.manifest,
        {name: plain.table(name) for name in ("scans", "odometry", "transforms")},
        bundle.grids(),
    )
    wide = perturbed("odometry_scale.translation", 3.0, bundle.view())

    first, other = (DeadReckoning().run(v, seed=0).track for v in (bundle.view(), wide))

    row = int(np.argmax(first.has_pose))
    assert row > 5
    np.testing.assert_allclose(other.xyyaw[row], first.xyyaw[row], atol=1e-9)


@pytest.mark.parametrize("level", [0.5, 0.999, 1e-6])
def test_a_switch_is_off_or_on(level):
    for name in PERTURBATIONS:
        for variant, about in PERTURBATIONS.load(name).variants.items():
            if about.is_switch:
                with pytest.raises(UsageError, match="neither 0 nor 1"):
                    perturbed(f"{name}.{variant}", level)
