"""Accuracy after a rigid alignment, held against evo; NEES beside it is never aligned."""

import json

import numpy as np
import pytest
import typer
from evo.core import metrics as evo_metrics
from evo.core.trajectory import PoseTrajectory3D
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from slamreplay.bundle.run import Estimate, Run, Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.track import PoseTrack
from slamreplay.cli import perturb
from slamreplay.geometry import se2, se3
from slamreplay.geometry.alignment import least_squares
from slamreplay.replay.metrics import ate_aligned, judging_reference, trial_metrics
from slamreplay.testing import edits, synthetic_bundle
from slamreplay.testing.synthetic import true_path


def tracks(seed, n=120, noise=0.05, frame="elsewhere"):
    """A path in the map, and its noisy reference in another frame."""
    rng = np.random.default_rng(seed)
    t_ns = np.arange(n, dtype=np.int64) * 100_000_000
    path = true_path(t_ns / 1e9)
    placed = se2.compose(np.array([14.6, -3.3, 2.2]), path + noise * rng.standard_normal((n, 3)))
    make = PoseTrack.without_covariance
    return make("map", "base_link", t_ns, path), make(frame, "base_link", t_ns, placed)


def evos(track, reference):
    def trajectory(one):
        xyz = np.column_stack([one.xyyaw[:, :2], np.zeros(len(one))])
        xyzw = se3.quaternion_from_yaw(one.xyyaw[:, 2])
        return PoseTrajectory3D(xyz, np.roll(xyzw, 1, axis=1), one.t_ns / 1e9)

    estimate, truth = trajectory(track), trajectory(reference)
    estimate.align(truth, correct_scale=False)
    ape = evo_metrics.APE(evo_metrics.PoseRelation.translation_part)
    ape.process_data((truth, estimate))
    return ape.get_statistic(evo_metrics.StatisticsType.rmse)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.3])
def test_the_aligned_error_is_evos(noise):
    track, reference = tracks(3, noise=noise)

    assert ate_aligned(track, reference) == pytest.approx(evos(track, reference), abs=1e-9)


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3))
def test_it_does_not_depend_on_the_frame_and_no_other_motion_does_better(x, y, yaw):
    track, reference = tracks(1)
    points, onto = track.xyyaw[:, :2], reference.xyyaw[:, :2]
    moved = PoseTrack.without_covariance(
        "m", "b", track.t_ns, se2.compose(np.array([x, y, yaw]), track.xyyaw)
    )
    best = least_squares(points, onto)

    def cost(motion):
        return np.sum((se2.transform_points(motion, points) - onto) ** 2)

    assert ate_aligned(moved, reference) == pytest.approx(ate_aligned(track, reference), abs=1e-9)
    assert cost(best) <= cost(best + 1e-3 * np.array([x, y, yaw]) / 50.0) + 1e-12


def test_a_reference_of_positions_alone_will_do_and_two_positions_will_not():
    track, reference = tracks(2)
    headless = reference.xyyaw.copy()
    headless[:, 2] = np.nan
    points = PoseTrack.without_covariance("m", "b", reference.t_ns, headless)

    assert ate_aligned(track, points) == pytest.approx(ate_aligned(track, reference))
    assert ate_aligned(track.take(np.arange(2)), reference) is None
    assert ate_aligned(None, reference) is None
    assert ate_aligned(track, None) is None


def test_in_a_frame_of_its_own_only_the_aligned_error_is_told():
    bundle = synthetic_bundle(seconds=6.0)
    truth = judging_reference(bundle)
    path = se2.compose(truth.xyyaw, np.array([0.3, 0.0, 0.0]))
    run = Run(
        Trial(bundle.manifest.bundle_id, "x", 0),
        Estimate(PoseTrack.without_covariance("map", "base_link", truth.t_ns, path)),
    )
    references = bundle.table("references")
    own = edits.rebuilt(
        bundle, {"references": references.replace(frame_id=["vicon"] * len(references))}
    )

    in_map, apart = (trial_metrics(run, [run], b) for b in (bundle, own))

    assert in_map["reference_rmse_m"] == pytest.approx(0.3)
    assert apart["reference_rmse_m"] is None
    assert apart["ate_aligned_m"] == pytest.approx(in_map["ate_aligned_m"])
    assert 0.0 < apart["ate_aligned_m"] < 0.3  # a lever along the heading turns with it


def test_the_command_shows_error_and_nees_with_its_interval(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = synthetic_bundle(seconds=6.0, with_tags=True)
    tables = {name: made.table(name) for name in TABLES}
    write_bundle(tmp_path / "b", made.manifest, tables, {"room": made.grid()})
    asked = ["perturb", f"{tmp_path}/b", "-o", f"{tmp_path}/R", "-e", "ekf", "-e", "recorded"]

    app = typer.Typer()
    app.callback()(lambda: None)
    perturb.register(app)
    text = CliRunner().invoke(app, asked, catch_exceptions=False).stdout
    ran = CliRunner().invoke(app, [*asked, "--json"], catch_exceptions=False)

    assert "ATE aligned [m]" in text
    assert "by chance (95 %)" in text
    for trial in json.loads(ran.stdout)["trials"]:
        told = trial["metrics"]
        assert told["nees_low"] < told["nees_dof"] == 3.0 < told["nees_high"]
        assert f"{told['nees_mean']:.3f}" in text
        assert told["ate_aligned_m"] <= told["reference_rmse_m"]
