"""What `slamreplay inspect` says: keys that stay, audits that are true, on any log."""

import json
import subprocess
import sys

import numpy as np
import pytest
import typer
from audited import healthy
from typer.testing import CliRunner

from slamreplay.bundle.schema import TABLES
from slamreplay.cli import explain
from slamreplay.cli import inspect as inspect_command
from slamreplay.consistency import AUDITS, CHECKS
from slamreplay.consistency.audits.inspection import inspect, summary
from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.testing.edits import rebuilt


@pytest.fixture(scope="module")
def sound():
    return healthy(seconds=10.0)


@pytest.fixture
def program():
    app = typer.Typer()
    inspect_command.register(app)
    explain.register(app)
    return app


def plain(answers):
    assert json.loads(json.dumps(answers, allow_nan=False)) == answers
    return answers


def test_keys_of_the_answers(sound):
    answers = plain(inspect(sound))
    topics = {t["topic"]: t for t in answers["clock"]["topics"]}

    assert summary(sound).items() <= answers.items()
    assert set(answers) == {
        *summary(sound), "clock", "frames", "lasers", "placeholders", "findings"
    }  # fmt: skip
    assert set(topics) >= {"/scan", "/odom", "/tf", "/tf_static", "/amcl_pose", "/truth"}
    assert topics["/scan"]["by"] == "header stamp"
    assert topics["/scan"]["log_minus_stamp_median_s"] == pytest.approx(0.0055, abs=0.002)
    assert topics["/scan"]["period_s"] == pytest.approx(0.1)
    assert topics["/amcl_pose"]["period_s"] is None  # it comes when it comes
    edges = {(e["parent"], e["child"]): e for e in answers["frames"]["tree"]}
    assert edges["map", "odom"]["ahead_s"] == pytest.approx(0.1)
    assert edges["map", "odom"]["ahead_of"] == "scan"
    assert edges["odom", "base_link"]["rate_hz"] == pytest.approx(20.0)
    assert edges["base_link", "laser"]["rate_hz"] is None
    assert answers["frames"]["corrections"]["count"] > 10
    assert answers["frames"]["odometry_jumps"]["count"] == 0
    assert [f["id"] for f in answers["findings"]] == ["SR-CLK-007"]
    assert set(AUDITS) <= set(CHECKS)


def one_row(table):
    return table.take(np.arange(min(len(table), 1)))


def two_rows(table):
    return table.take(np.arange(min(len(table), 2)))


def no_rows(table):
    return table.take(np.arange(0))


def no_stamps(table):
    return table.replace(t_sensor_ns=np.full(len(table), NO_STAMP))


def one_time(table):
    t = np.full(len(table), 5)
    return table.replace(t_ns=t, t_sensor_ns=t, t_log_ns=t)


def wild_stamps(table):
    rng = np.random.default_rng(0)
    t = rng.integers(-(10**18), 4 * 10**18, len(table))
    return table.replace(t_sensor_ns=t, t_ns=t).sorted_by_time()


def not_numbers(table):
    wild = {}
    for column in table.schema.columns:
        data = table[column.name]
        if column.kind == "float64" and not column.name.endswith("xyzw"):
            wild[column.name] = np.where(np.arange(len(data)).reshape((-1, *[1] * (data.ndim - 1)))
                                         % 3 == 0, np.nan, np.inf) + 0 * data  # fmt: skip
    return table.replace(**wild) if table.schema.name not in ("transforms",) else table


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "spoil", [one_row, two_rows, no_rows, no_stamps, one_time, wild_stamps, not_numbers]
)
def test_no_log_is_so_odd_that_it_cannot_be_looked_at(sound, spoil):
    plain(inspect(rebuilt(sound, {name: spoil(sound.table(name)) for name in TABLES})))
    for name in ("scans", "odometry", "transforms", "poses"):
        plain(inspect(rebuilt(sound, {name: spoil(sound.table(name))})))


@pytest.mark.parametrize("name", ["healthy.mcap", "changed_aisle.mcap", "healthy_short.bag"])
def test_a_sample_log_without_a_fault_has_no_warning(request, program, name):
    log = request.config.rootpath / "sample_logs" / name
    result = CliRunner().invoke(program, ["inspect", str(log)])

    assert result.exit_code == 0, result.output
    assert "warning" not in result.stdout
    assert "dated 1.000 s ahead of the scan" in result.stdout
    assert "orientation_xyzw marked as not given" in result.stdout.replace("\n", " ")


#: What was counted in these logs by hand, with other tools.
REAL = {
    "birmingham/trace0.bag": [
        "stamps later than the log time: /base_scan all 958, by 0.010 s",
        "map -> odom is dated 0.100 s ahead of the scan it was made from",
        "2 of 958 scans had to wait for them longer than 0.2 s, up to 0.25 s",
    ],
    "evo_nav2/nav2_turtlebot.mcap": [
        "simulated time, at 0.9932 of the log's pace",
        "/odom at 27.8 Hz: a gap of 1.76 s at 40.8 s",
        "map -> odom at 10.1 Hz has 3 gaps, the longest 2.30 s at 41.6 s",
        "pose_covariance all zero in 2639 of 2639",
    ],
    "zaki_kidnap/dec13/target_after.bag": [
        "log time minus header stamp is 698028.719 s and does not drift: stamps of another epoch",
        "not on the clock of the other sensors: /tf map -> odom +698028.7",
        "map -> odom is dated 0.050 s ahead of when it was sent",
        "at the most 5.84 m (28.1 s) and 45 deg",
    ],
    "olin_neato/ac109_1_demo.bag": [
        "121 of 553 scans repeat the one before although the robot moved",
        "stamps that go back: /stable_scan 19 of 553, by up to 0.007 s",
        "frame names with a leading slash, which tf2 refuses: /tf 511 times",
    ],
    "olin_tb4/macfirst_floor_take_2": [
        "base_link -> mouse (3.167 m apart",
        "12 of 357 scans had to wait for them longer than 0.2 s, up to 0.41 s",
    ],
    "stage_amcl/systematic_ground_truth_poses_and_estimated_poses.bag": [
        "18 of 18 published covariances are one and the same although the robot moved",
    ],
    "inesctec_jarvis/jarvis_circular_path_fast.bag": [],
}


@pytest.mark.parametrize("name", REAL)
def test_what_is_said_of_real_logs_is_true(real_logs, tmp_path, name):
    bundle = ingest([real_logs / name], tmp_path / "b", IngestOptions())
    found = plain(inspect(bundle))["findings"]
    said = "\n".join(f["message"] for f in found)

    for words in REAL[name]:
        assert words in said
    if not REAL[name]:
        assert found == []


def test_finding_ids_of_audits_are_explained(program):
    result = CliRunner().invoke(program, ["explain", "SR-TF-003"])

    assert result.exit_code == 0
    assert "transform" in result.stdout


def test_inspecting_loads_no_statistics():
    # Its checks ask no belief: who only wants to see what a log holds does not wait for scipy.
    code = (
        "import sys, slamreplay.consistency.audits.inspection;"
        "heavy = {'scipy', 'numba', 'gtsam', 'matplotlib', 'pandas'};"
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)

    assert done.returncode == 0, done.stderr
