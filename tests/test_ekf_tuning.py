"""Settings found from a log's own innovations."""

from dataclasses import replace

import numpy as np
import pytest
from ekf_world import world
from scipy.optimize import approx_fprime

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.nees import nees
from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.estimator import MEASUREMENT_NOISE, PROCESS_NOISE, Ekf, EkfTuned
from slamreplay.estimators.ekf.filter import filtered, gates_of
from slamreplay.estimators.ekf.likelihood import OUTLIERS, log_densities, score_vectors
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.tuning import tuned
from slamreplay.estimators.start import GLOBAL, Start
from slamreplay.testing import edits
from slamreplay.testing.estimators import estimate_bytes
from slamreplay.testing.synthetic import synthetic_bundle

GATES = gates_of(0.999)
#: Another robot than the one that the priors expect.
ODD = Noise(
    position_per_metre=0.06,
    heading_per_metre=0.05,
    heading_per_turn=0.12,
    range_m=0.01,
    range_per_m=0.008,
    bearing_rad=0.005,
    lasting_range_per_m=0.03,
    lasting_bearing_rad=0.01,
    lasting_s=8.0,
    range_ratio=1.04,
    distance_ratio=0.97,
    turn_ratio=0.93,
)
LOG, TRUTH = world(5, ODD, seconds=250.0)


def summary(evidence, truth, noise):
    out = filtered(evidence, replace(noise, mount_m=0.0, mount_rad=0.0), GATES)
    reference = PoseTrack.without_covariance("map", "base_link", evidence.row_ns, truth)
    track = PoseTrack("map", "base_link", evidence.row_ns, out.xyyaw, out.cov)
    return nees(track, reference).summary()


def bearing_of(noise):
    """Of one sighting: a lasting error that changes within a frame is as good as a white one."""
    return np.hypot(noise.bearing_rad, noise.lasting_bearing_rad)


@pytest.fixture(scope="module")
def fit():
    return tuned(LOG, GATES)


def test_noise_and_constant_errors_are_found(fit):
    found = fit.noise
    for name in ("heading_per_turn", "range_per_m", "bearing_rad", "lasting_range_per_m",
                 "lasting_bearing_rad"):  # fmt: skip
        assert getattr(found, name) == pytest.approx(getattr(ODD, name), rel=0.4), name
    assert found.range_ratio == pytest.approx(1.04, abs=0.02)
    assert found.turn_ratio == pytest.approx(0.93, abs=0.04)
    assert found.distance_ratio == pytest.approx(0.97, abs=0.03)
    assert found.odometry_delay_s == pytest.approx(0.0, abs=0.05)
    assert found.range_falloff == pytest.approx(0.0, abs=0.02)


def test_what_was_found_makes_the_filter_consistent(fit):
    assert summary(LOG, TRUTH, Noise()).credibility == "overconfident"
    assert summary(LOG, TRUTH, fit.noise).credibility == "consistent"


def test_it_predicts_another_log_of_the_same_robot(fit):
    other, _ = world(6, ODD, seconds=100.0)
    density = {
        name: log_densities(other.observations, filtered(other, noise, GATES), noise).mean()
        for name, noise in (("untuned", Noise()), ("tuned", fit.noise), ("true", ODD))
    }
    assert density["tuned"] > density["untuned"] + 0.5
    assert density["tuned"] == pytest.approx(density["true"], abs=0.1)


def test_a_late_odometry_is_found():
    evidence, _ = world(7, replace(Noise(), bearing_rad=0.01), seconds=120.0, every=4)
    early = evidence.odometry
    early = PoseTrack(early.frame_id, early.child_frame_id, early.t_ns - 150_000_000,
                      early.xyyaw.copy(), early.cov.copy())  # fmt: skip
    found = tuned(replace(evidence, odometry=early), GATES).noise

    assert found.odometry_delay_s == pytest.approx(0.15, abs=0.03)


def test_a_depth_that_is_called_a_range_is_found():
    evidence, _ = world(8, replace(Noise(), range_per_m=0.01, range_m=0.01), seconds=120.0)
    seen = evidence.observations
    ahead = np.abs(seen.sensed[:, 1]) < 0.6  # a camera sees no farther aside
    polar = seen.sensed.copy()
    polar[:, 0] *= np.cos(polar[:, 1] - 0.05)
    found = tuned(replace(evidence, observations=replace(seen, sensed=polar).take(ahead)), GATES)

    assert found.noise.range_falloff == pytest.approx(0.48, abs=0.05)
    assert found.noise.range_axis_rad == pytest.approx(0.05, abs=0.03)


def test_wrong_names_do_not_spoil_it():
    evidence, truth = world(9, seconds=120.0, wrong=0.05)
    found = tuned(evidence, GATES).noise

    assert found.range_per_m == pytest.approx(0.04, rel=0.4)
    assert bearing_of(found) == pytest.approx(0.02, rel=0.3)
    assert summary(evidence, truth, found).test.mean < 6.0


def test_rejecting_everything_is_no_way_out():
    """Settings that reject all pay the price of an outlier for each: more than any fair fit."""
    seen = LOG.observations
    sure = replace(Noise(), range_m=1e-4, range_per_m=1e-4, bearing_rad=1e-4)
    rejecting = filtered(LOG, sure, GATES, 1e-6)
    fair = filtered(LOG, Noise(), GATES)
    price = np.log(OUTLIERS) - np.log(seen.sensed[:, 0].max()) - np.log(2.0 * np.pi)

    rejected = rejecting.status == kernels.REJECTED
    assert rejected.mean() > 0.8
    densities = log_densities(seen, rejecting, sure)
    np.testing.assert_allclose(densities[rejected & (densities < price + 0.1)], price, atol=0.1)
    assert densities.sum() < log_densities(seen, fair, Noise()).sum() - 1000.0
    assert (log_densities(seen, rejecting, sure) >= price - 1e-9).all()


def test_scores_are_the_information_of_the_likelihood():
    """Their product against minus the second derivative of the likelihood, on average."""
    noise = replace(Noise(), bearing_rad=0.02)
    step, found, expected = 1e-3, [], []

    def told(x):
        return replace(noise, bearing_rad=0.02 * np.exp(x))

    def at(evidence, x):
        return filtered(evidence, told(x), gates_of(1.0))

    for seed in range(8):
        evidence, _ = world(seed, noise, seconds=60.0)
        seen = evidence.observations
        vectors = score_vectors(seen, at(evidence, 0.0), [at(evidence, step)], step)
        found.append(float(vectors[0] @ vectors[0]))

        def minus(x, evidence=evidence, seen=seen):
            return -float(log_densities(seen, at(evidence, x[0]), told(x[0])).sum())

        slopes = [approx_fprime(np.array([x]), minus, 1e-4)[0] for x in (-0.02, 0.02)]
        expected.append((slopes[1] - slopes[0]) / 0.04)
    assert np.mean(found) == pytest.approx(np.mean(expected), rel=0.1)


def test_few_sightings_leave_the_settings_near_to_what_is_usual():
    evidence, _ = world(10, seconds=10.0)
    few = replace(evidence, observations=evidence.observations.take(np.arange(8)))
    found = tuned(few, GATES).noise

    assert 0.003 < found.bearing_rad < 0.04
    assert abs(found.range_ratio - 1.0) < 0.05
    none = tuned(replace(evidence, observations=evidence.observations.take(np.arange(0))), GATES)
    assert none.sightings == 0
    assert none.after is None


def test_a_start_that_nobody_gave_is_found_once():
    evidence, _ = world(11, seconds=100.0)
    evidence = replace(evidence, given=[Start(0, None, np.eye(3))])

    assert bearing_of(tuned(evidence, GATES).noise) == pytest.approx(0.02, rel=0.3)


def test_the_estimator_keeps_what_it_fitted_and_never_sees_a_judge():
    bundle = synthetic_bundle(seconds=20.0, with_tags=True)
    one, lied = (EkfTuned().run(b.view(), seed=1) for b in (bundle, edits.poisoned(bundle)))

    assert estimate_bytes(one) == estimate_bytes(lied)
    assert one.scalars["fit.sightings"] > 100
    assert one.scalars["fit.log_density_after"] > one.scalars["fit.log_density_before"]
    assert 0.003 < one.scalars["fitted.bearing_rad"] < 0.03
    assert 0.01 < one.scalars["fitted.heading_rad"] < 0.06
    assert "fitted.stated_ratio" not in one.scalars


def test_perturbed_settings_act_on_what_was_fitted_without_them():
    view = synthetic_bundle(seconds=20.0, with_tags=True).view().with_setting(GLOBAL, 1.0)
    half = view.with_setting(PROCESS_NOISE, 0.25).with_setting(MEASUREMENT_NOISE, 0.25)
    plain, sure = (EkfTuned().run(v, seed=1) for v in (view, half))

    assert plain.scalars["fitted.bearing_rad"] == sure.scalars["fitted.bearing_rad"]
    known = plain.track.has_pose & sure.track.has_pose
    ratio = plain.track.cov[known, 0, 0] / sure.track.cov[known, 0, 0]
    assert np.median(ratio) == pytest.approx(4.0, abs=0.8)


def test_noise_that_the_log_states_is_used_and_its_size_fitted():
    bundle = synthetic_bundle(seconds=20.0, with_tags=True)
    references = bundle.table("references")
    covariance = references["covariance"].copy()
    sensed = references["kind"] == "fiducial"
    told = np.diag([0.1**2, 0.1**2, 0.1**2, 0.2**2, 0.2**2, 0.2**2]).ravel()
    covariance[sensed] = told  # far too much: the simulator has 0.02 m and 0.03 rad
    view = bundle.view().with_table(references.replace(covariance=covariance))
    found = EkfTuned().run(view, seed=1).scalars

    assert found["fitted.stated_ratio"] < 0.5
    assert "fitted.range_m" not in found
    wide, usual = (Ekf().run(v, seed=1).innovations[-1].S for v in (view, bundle.view()))
    assert wide[:, 2, 2].mean() > 3.0 * usual[:, 2, 2].mean()  # 0.2 rad instead of 0.1
