"""`slamreplay export --to tum`: every scan a line, in the order and with the stamps of the log."""

import json

import numpy as np
import pytest
import typer
from evo.tools import file_interface
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from slamreplay.bundle.run import Estimate, Run, Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.track import PoseTrack
from slamreplay.cli import export, perturb
from slamreplay.errors import OutputError, UsageError
from slamreplay.export.request import Request
from slamreplay.export.tum import bundle_as_tum, runs_as_tum, trial_name, write_tum
from slamreplay.geometry.covariance import (
    openvins_from_ros,
    planar_from_ros,
    ros_from_openvins,
)
from slamreplay.ingest.reference_file import read_reference
from slamreplay.testing.synthetic import synthetic_bundle


@pytest.fixture
def bundle(tmp_path):
    made = synthetic_bundle(seconds=3.0)
    write_bundle(tmp_path / "b", made.manifest, {n: made.table(n) for n in TABLES}, {})
    return tmp_path / "b"


def call(*arguments: object, catch_exceptions=True):
    app = typer.Typer()
    app.callback()(lambda: None)
    export.register(app)
    perturb.register(app)
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=catch_exceptions)


def everything(t_ns):
    return np.ones(len(t_ns), dtype=bool)


def backward_stamps():
    """A bundle whose scans are stamped 50 us apart, out of order, and a run over them."""
    made = synthetic_bundle(seconds=1.0)
    scans = made.table("scans")
    stamp = scans["t_sensor_ns"].copy()
    stamp[[3, 4]] = stamp[[4, 3]] + 123
    scans = scans.replace(t_sensor_ns=stamp)
    made = type(made)(made.manifest, {**made._tables, "scans": scans}, {})
    xyyaw = np.arange(30.0).reshape(10, 3) / 10
    xyyaw[0] = np.nan
    track = PoseTrack.without_covariance("map", "base_link", scans.t_ns, xyyaw)
    return made, stamp, Run(Trial("id", "amcl", 0), Estimate(track))


def test_nothing_is_dropped_sorted_or_passed_through_a_float():
    bundle, stamp, run = backward_stamps()
    content = runs_as_tum(bundle, [run])

    assert list(content) == ["amcl"]
    lines = [line.split() for line in content["amcl"].lines(everything).splitlines()]
    assert [int(line[0].replace(".", "")) for line in lines] == stamp.tolist()
    assert lines[0][1:] == ["nan", "nan", "0.000000", *["nan"] * 4]
    assert [float(v) for v in lines[1][1:3]] == [0.3, 0.4]
    assert 2 * np.arcsin(float(lines[1][6])) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("trial", "with_seed", "name"),
    [
        (Trial("", "amcl", 3), False, "amcl"),
        (Trial("", "amcl", 3), True, "amcl-s3"),
        (Trial("", "amcl", 3, "scan_drop.random", 0.25), True, "amcl-scan_drop-0.25-s3"),
        (Trial("", "ekf", 0, "initial_pose.rotate", 90.0), False, "ekf-initial_pose.rotate-90"),
    ],
)
def test_files_are_named_by_their_trial(trial, with_seed, name):
    assert trial_name(trial, with_seed=with_seed) == name


@pytest.mark.parametrize("name", ["../../amcl", "/tmp/amcl", "a/../b", "x" * 400])
def test_no_name_leads_out_of_the_folder(name, tmp_path):
    bundle, _, run = backward_stamps()
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    write_tum(Request(bundle, [Run(Trial("id", name, 0), run.estimate)]), folder)
    assert [p.parent for p in tmp_path.rglob("*.tum")] == [folder]


def test_a_run_without_estimate_has_no_file_and_none_at_all_is_said():
    bundle, _, _ = backward_stamps()
    with pytest.raises(UsageError, match="no run has an estimate"):
        runs_as_tum(bundle, [Run(Trial("id", "amcl", 0), None, "no map")])


def test_a_bundle_gives_belief_odometry_and_references():
    content = bundle_as_tum(synthetic_bundle(seconds=3.0, with_tags=True))
    assert sorted(content) == ["belief", "odometry", "reference-truth"]


def test_covariances_are_openvins_and_read_back_as_a_reference(tmp_path):
    bundle, stamp, run = backward_stamps()
    cov = np.tile(np.diag([0.04, 0.09, 0.01]), (10, 1, 1))
    cov[:, 0, 1] = cov[:, 1, 0] = 0.02
    cov[5] = np.nan
    track = PoseTrack("map", "base_link", run.estimate.track.t_ns, run.estimate.track.xyyaw, cov)
    run = Run(run.trial, Estimate(track))
    request = Request(bundle, [run], covariance=True)
    write_tum(request, tmp_path)

    assert sorted(p.name for p in tmp_path.iterdir()) == ["amcl.openvins.txt", "amcl.tum"]
    rows, losses = read_reference(tmp_path / "amcl.openvins.txt", "map", "base_link")
    assert not losses
    kept = [k for k in range(10) if k not in (0, 5)]  # no pose, no covariance
    order = np.argsort(rows.t_sensor_ns)
    kept_order = np.argsort(stamp[kept])
    np.testing.assert_array_equal(rows.t_sensor_ns[order], stamp[kept][kept_order])
    back = planar_from_ros(rows.columns["covariance"])[order]
    want = cov[kept][kept_order]
    np.testing.assert_allclose(back, want, atol=1e-9)


def test_covariances_that_nobody_knows_are_told(bundle, tmp_path):
    ran = call("export", bundle, "--to", "tum", "--covariance", "-o", tmp_path / "T")
    assert ran.exit_code == 0, ran.output

    head = json.loads((tmp_path / "T" / "export.json").read_text())
    for told in head["not_as_recorded"]:
        stem = told["what"].removeprefix("covariances of ")
        assert f"{stem}.tum" in head["files"]
        assert f"{stem}.openvins.txt" not in head["files"]
    written = [n for n in head["files"] if n.endswith(".openvins.txt")]
    trajectories = [n for n in head["files"] if n.endswith(".tum")]
    assert len(written) + len(head["not_as_recorded"]) == len(trajectories)


def test_a_window_leaves_lines_out(bundle, tmp_path):
    ran = call("export", bundle, "--to", "tum", "-o", tmp_path / "T", "--start", 1, "--end", 2)
    assert ran.exit_code == 0, ran.output
    lines = (tmp_path / "T" / "odometry.tum").read_text().splitlines()
    assert len(lines) == 11
    head = json.loads((tmp_path / "T" / "export.json").read_text())
    assert head["window_ns"][1] - head["window_ns"][0] == 1_000_000_000


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--to", "tum", "--only", "recorded"), "takes no --only"),
        (("--to", "mcap", "--covariance"), "takes no --covariance"),
        (("--to", "tum", "--start", 90), "nothing is left"),
        (("--to", "tum", "--start", 2, "--end", 1), "nothing is left"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(bundle, tmp_path, more, words):
    ran = call("export", bundle, *more, "-o", tmp_path / "T")
    assert isinstance(ran.exception, UsageError)
    assert words in str(ran.exception)
    assert not (tmp_path / "T").exists()


def test_evo_reads_what_the_command_writes(bundle, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    call("perturb", bundle, "-e", "dead_reckoning", "-p", "scan_drop=0.5", "-o", tmp_path / "R")
    ran = call("export", tmp_path / "R", "--to", "tum", "-o", tmp_path / "T", "--json")

    assert json.loads(ran.stdout)["files"] == [
        "dead_reckoning-scan_drop-0.5.tum",
        "dead_reckoning.tum",
    ]
    trajectory = file_interface.read_tum_trajectory_file(tmp_path / "T" / "dead_reckoning.tum")
    assert trajectory.num_poses == 30
    again = call("export", tmp_path / "R", "--to", "tum", "-o", tmp_path / "T")
    assert again.exit_code == 0, again.output


def test_a_folder_of_somebody_else_stays(bundle, tmp_path):
    (tmp_path / "D").mkdir()
    (tmp_path / "D" / "x").write_text("mine")
    ran = call("export", bundle, "--to", "tum", "-o", tmp_path / "D")
    assert isinstance(ran.exception, OutputError)
    assert [p.name for p in (tmp_path / "D").iterdir()] == ["x"]


def test_openvins_blocks_are_turned_into_the_body_and_back():
    """At a pose in space: in the plane the turn would leave the heading's variance as it is."""
    rng = np.random.default_rng(5)
    A = rng.normal(size=(2, 3, 3))
    rotation, position = A @ np.swapaxes(A, 1, 2)
    R = Rotation.from_rotvec([0.3, -0.7, 1.1]).as_matrix()
    back = openvins_from_ros(ros_from_openvins(rotation, position, R), R)
    np.testing.assert_allclose(back[0], rotation, atol=1e-12)
    np.testing.assert_allclose(back[1], position, atol=1e-12)
