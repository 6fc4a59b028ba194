"""`slamreplay perturb`: a table or JSON on stdout, runs on disk, and nothing on faults."""

import json

import pytest
import typer
from typer.testing import CliRunner

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.view import Bundle
from slamreplay.cli import perturb
from slamreplay.errors import OutputError, SlamreplayError, UsageError
from slamreplay.replay.design import usual_estimators
from slamreplay.replay.folder import read_runs
from slamreplay.testing.synthetic import synthetic_bundle


@pytest.fixture
def bundle(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = synthetic_bundle(seconds=4.0)
    tables = {name: made.table(name) for name in TABLES}
    write_bundle(tmp_path / "b", made.manifest, tables, {"room": made.grid()})
    return tmp_path / "b"


def call(*arguments: object):
    app = typer.Typer()
    app.callback()(lambda: None)
    perturb.register(app)
    return CliRunner().invoke(app, ["perturb", *map(str, arguments)], catch_exceptions=True)


def test_baseline_stands_beside_each_perturbation(bundle, tmp_path):
    ran = call(bundle, "-o", tmp_path / "R", "-p", "tf_delay=0.2", "-p", "initial_pose.global=1")

    lines = [line.split() for line in ran.stdout.splitlines()]
    assert [line[:2] for line in lines[1:]] == [
        [estimator, what]
        for estimator in usual_estimators(Bundle.open(bundle))
        for what in ("(baseline)", "tf_delay.odometry", "initial_pose.global")
    ]
    assert lines[1][2:6] == ["0.000"] * 4
    assert "not applicable" in ran.stdout.splitlines()[-1]
    assert len(read_runs(tmp_path / "R")[1]) == len(lines) - 1
    assert not (tmp_path / "R" / "bundle").exists()  # it is where the user has it


def test_json_holds_every_trial_with_numbers_or_null(bundle, tmp_path):
    ran = call(
        bundle, "-o", tmp_path / "R", "-e", "dead_reckoning", "-p", "scan_drop=0.5", "--json"
    )

    trials = json.loads(ran.stdout)["trials"]
    assert [t["perturbation"] for t in trials] == [None, "scan_drop.random"]
    assert trials[1]["unit"] == "ratio"
    assert trials[0]["metrics"]["baseline_max_m"] == 0.0


def test_parameters_from_a_file_reach_the_estimator_and_are_told(bundle, tmp_path):
    (tmp_path / "nav2_params.yaml").write_text(
        "amcl: {ros__parameters: {max_particles: 60, min_particles: 30, tf_broadcast: true}}"
    )
    out = ("-o", tmp_path / "R", "--parameters", tmp_path / "nav2_params.yaml")

    ran = call(bundle, *out, "-e", "amcl", "-e", "dead_reckoning", "--json")

    assert "amcl: 2 parameters given, 1 of the live node has no part" in ran.stderr
    trials = json.loads(ran.stdout)["trials"]
    assert [t["parameters"] for t in trials] == [{"max_particles": 60, "min_particles": 30}, None]
    runs = read_runs(tmp_path / "R")[1]
    assert runs[0].estimate.diagnostics["particles"].max() <= 60


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["-p", "tf_delay=nan"], UsageError),
        (["-p", "tf_dely=1"], UsageError),
        (["-e", "acml"], UsageError),
        (["--seed", "-1"], UsageError),
        (["--start", "1"], UsageError),
    ],
)
def test_nonsense_is_refused_and_leaves_nothing(bundle, tmp_path, arguments, fault):
    ran = call(bundle, "-o", tmp_path / "R", *arguments)

    assert isinstance(ran.exception, fault)
    assert not (tmp_path / "R").exists()


def test_a_foreign_folder_and_a_missing_log_are_refused(bundle, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years of work")

    assert isinstance(call(bundle, "-o", tmp_path / "mine").exception, OutputError)
    assert isinstance(call(tmp_path / "no.bag", "-o", tmp_path / "R").exception, SlamreplayError)
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_why_an_estimator_did_not_run_widens_no_column(tmp_path, monkeypatch):
    """A log without a reference has a single column of numbers."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = synthetic_bundle(seconds=3.0, with_map=False)
    tables = {name: made.table(name) for name in TABLES if name != "references"}
    write_bundle(tmp_path / "b", made.manifest, tables, {})
    ran = call(tmp_path / "b", "-o", tmp_path / "R", "-e", "dead_reckoning", "-e", "amcl")

    head, drift, amcl = ran.stdout.splitlines()
    assert head.split() == ["estimator", "perturbation", "level", "poses"]
    assert drift.split() == ["dead_reckoning", "(baseline)", "30"]
    assert len(drift) < 60
    assert "not applicable: amcl: needs a map" in amcl
