"""Relations from a file and the metric on them: the benchmark's, and every mistake in one line."""

import bz2

import numpy as np
import pytest
import typer
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from slamreplay.bundle.run import Trial
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.cli import perturb
from slamreplay.errors import LogError
from slamreplay.geometry import se2, se3
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.relations_file import read_relations
from slamreplay.postmortem import postmortem
from slamreplay.replay.relations import relation_errors, relation_metrics
from slamreplay.replay.runner import replay
from slamreplay.report.html import html

STAMPS = np.array([10_000_000_000, 10_200_000_000, 10_100_000_000, 11_000_000_000])
T_NS = STAMPS + 5
#: CARMEN: ODOM x y theta tv rv accel ipc_time host logger_time; FLASER n ranges x y theta odom.
LOG = "".join(
    f"ODOM {k / 10} 0 0 0 0 0 {100 + k / 10:.6f} h {k / 10}\n"
    f"FLASER 3 1.0 2.0 1.0 {k / 10} 0 0 {k / 10} 0 0 {100 + k / 10:.6f} h {k / 10}\n"
    for k in range(1, 31)
)


def read(tmp_path, text):
    path = tmp_path / "x.relations"
    path.write_text(text, encoding="utf-8")
    return read_relations(path, "base_link", STAMPS, T_NS)


def test_pairs_name_scans_by_stamps_that_need_not_be_in_order(tmp_path):
    rows, t_ns, losses = read(tmp_path, "# no pair\n10.2 10.1 1 2 0 0 0 0.5\n10.2 12 1 2 0 0 0 0\n")

    assert t_ns.tolist() == [T_NS[1]]
    assert rows.columns["t2_sensor_ns"].tolist() == [STAMPS[2]]
    assert se3.yaw_from_quaternion(rows.columns["orientation_xyzw"])[0] == pytest.approx(0.5)
    assert [(loss.count, loss.kind) for loss in losses] == [(1, "skipped")]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("10.2 10.1 1 2 0\n", "line 1: 5 columns"),
        ("10.2 10.1 1 2 0 0 0 0\n10.2 10.1 1 x 0 0 0 0\n", "line 2: times or numbers"),
        ("10.2 10.1 1 2 0 0 0 nan\n", "line 1: times or numbers"),
        ("1 2 0 0 0 0 0 0\n", "no relation is between two scans"),
        ("", "no relation is between two scans"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, text, says):
    with pytest.raises(LogError) as fault:
        read(tmp_path, text)
    assert says in str(fault.value)


def test_turns_are_about_fixed_axes():
    angles = np.array([[0.1, -0.4, 2.0], [-3.0, 1.2, -0.3]])
    ours = se3.quaternion_from_rpy(*angles.T)
    np.testing.assert_allclose(ours, Rotation.from_euler("xyz", angles).as_quat(), atol=1e-12)


def test_error_is_that_of_the_motion_whatever_the_frame():
    rng = np.random.Generator(np.random.PCG64(0))
    path = rng.uniform(-3, 3, (6, 3))
    rows = np.array([[0, 3], [4, 1], [2, 5]])
    measured = se2.between(path[rows[:, 0]], path[rows[:, 1]])
    elsewhere = se2.compose(np.array([5.0, -7.0, 2.0]), path)
    np.testing.assert_allclose(relation_errors(elsewhere, rows, measured), 0.0, atol=1e-12)
    measured = se2.compose(measured, np.array([0.3, -0.4, 0.1]))
    off = relation_errors(path, rows, measured)
    np.testing.assert_allclose(np.hypot(off[:, 0], off[:, 1]), 0.5, atol=1e-12)
    np.testing.assert_allclose(np.abs(off[:, 2]), 0.1, atol=1e-12)


@pytest.fixture
def with_relations(tmp_path):
    (tmp_path / "a.clf").write_text(LOG, encoding="utf-8")
    (tmp_path / "a.relations").write_text(
        "100.5 101.5 1.1 0 0 0 0 0\n100.7 102.5 1.8 0.3 0 0 0 0.2\n", encoding="utf-8"
    )
    return tmp_path


def test_relations_of_a_log_judge_and_are_seen_by_nobody_else(with_relations):
    options = IngestOptions(reference=with_relations / "a.relations")
    bundle = ingest([with_relations / "a.clf"], with_relations / "b", options)
    scans = bundle.table("scans")
    xyyaw = np.column_stack([np.arange(1, 31) / 10, np.zeros(30), np.zeros(30)])
    track = PoseTrack.without_covariance("odom", "base_link", scans.t_ns, xyyaw)

    found = relation_metrics(track, bundle)
    assert found["relations_n"] == 2.0
    assert found["relations_m"] == pytest.approx(0.2)
    assert found["relations_rad"] == pytest.approx(0.1)
    assert found["relations_std_m"] == pytest.approx(0.1)
    assert len(bundle.table("relations")) == 2
    assert len(bundle.view().table("relations")) == 0
    assert len(bundle.view().recorded("relations")) == 0
    assert relation_metrics(None, bundle)["relations_m"] is None


def test_perturb_prints_them(with_relations, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(with_relations / "cache"))
    app = typer.Typer()
    app.callback()(lambda: None)
    perturb.register(app)
    ran = CliRunner().invoke(
        app,
        ["perturb", str(with_relations / "a.clf"), "--reference",
         str(with_relations / "a.relations"), "-e", "dead_reckoning", "-o",
         str(with_relations / "R")],
    )  # fmt: skip
    assert ran.exit_code == 0, ran.output
    assert "relations [m]" in ran.stdout
    assert ran.stdout.split()[-2:] == ["0.2000", "0.1000"]


def test_bundles_of_before_have_none(tmp_path, with_relations):
    made = ingest([with_relations / "a.clf"], tmp_path / "b")
    tables = {k: v for k, v in made.manifest.tables.items() if k != "relations"}
    manifest = made.manifest.model_copy(update={"tables": tables})
    assert len(Bundle(manifest, {}, {}, made.path).table("relations")) == 0


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("intel", (7.370, 14.349, 39.17, 53.79)),
        ("aces", (0.549, 2.674, 2.33, 6.50)),
    ],
)
def test_metric_of_raw_odometry_is_the_published_one(real_logs, name, expected):
    """Of the odometry on FLASER lines, as others scored it; keys are the ipc times."""
    odometry, row_of = [], {}
    with bz2.open(real_logs / "radish" / f"{name}.clf.bz2", "rt") as lines:
        for cells in (line.split() for line in lines if line.startswith("FLASER")):
            row_of[float(cells[-3])] = len(odometry)
            odometry.append([float(v) for v in cells[-6:-3]])
    pairs = np.loadtxt(real_logs / "radish" / f"{name}.relations")
    rows = np.array([[row_of[t] for t in pair] for pair in pairs[:, :2]])
    measured = pairs[:, [2, 3, 7]]

    off = relation_errors(np.array(odometry), rows, measured)
    distance, turn = np.hypot(off[:, 0], off[:, 1]), np.degrees(np.abs(off[:, 2]))
    found = (distance.mean(), distance.std(), turn.mean(), turn.std())
    np.testing.assert_allclose(found, expected, rtol=0.002)


def test_the_report_shows_them_beside_the_map_that_slam_made(with_relations):
    bundle = ingest(
        [with_relations / "a.clf"],
        with_relations / "b",
        IngestOptions(reference=with_relations / "a.relations"),
    )
    runs = replay(bundle, [Trial(bundle.manifest.bundle_id, "dead_reckoning", 0)])
    page = html(postmortem(bundle, runs))
    assert "mean error of relations [m]" in page
    assert "The map that the pose graph made" not in page
