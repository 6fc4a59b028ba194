"""Whoever looks at a batch of trials sees what is done, and what a kill left of it."""

import json
import subprocess
import sys
import time

import pytest
from typer.testing import CliRunner

from slamreplay.bundle.run import Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.view import Bundle
from slamreplay.cli import inspect, perturb
from slamreplay.cli.main import app
from slamreplay.replay.design import design
from slamreplay.replay.runner import Replayer
from slamreplay.replay.watch import TrialState, look, watched
from slamreplay.testing.synthetic import synthetic_bundle

TEXTS = [f"tf_delay={k / 1000}" for k in range(1, 41)]


@pytest.fixture(scope="module")
def bundle(tmp_path_factory) -> Bundle:
    made, path = synthetic_bundle(seconds=4.0), tmp_path_factory.mktemp("log") / "b"
    write_bundle(path, made.manifest, {n: made.table(n) for n in TABLES}, {"room": made.grid()})
    return Bundle.open(path)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "slamreplay"


def run(*arguments):
    for command in (inspect, perturb):
        if not any(c.name == command.__name__.rsplit(".", 1)[1] for c in app.registered_commands):
            command.register(app)
    result = CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def inspected(folder):
    return json.loads(run("inspect", folder, "--json"))


def test_a_batch_is_told_of_while_it_runs_and_no_more_when_it_ended_well(bundle, tmp_path, cache):
    trials = design(bundle, ["dead_reckoning"], ["tf_delay=0.1", "initial_pose=1"], 0)
    seen = []

    def look_on(words, share):
        watch._told_s = 0.0  # it writes seldom
        seen.append(look(cache / "watch", tmp_path / "R"))

    with watched(cache / "watch", tmp_path / "R") as watch:
        replayer = Replayer(bundle, cache=cache / "runs", watch=watch, progress=look_on)
        with replayer:
            replayer.replay(trials)
        middle, during = seen[3], inspected(tmp_path / "R")

    assert [s.state for s in middle.trials] == ["done", "running", "waiting"]
    assert [s.trial for s in middle.trials] == trials
    assert middle.is_running
    assert middle.trials[0].seconds > 0.0
    assert middle.left_s > 0.0
    assert during["state"] == "running"
    assert [row["state"] for row in during["trials"]] == ["done"] * 3
    assert during["trials"][2]["metrics"]["baseline_median_m"] == pytest.approx(1.0)
    assert look(cache / "watch", tmp_path / "R") is None


def test_rounds_add_up_and_a_fault_leaves_what_was_told(bundle, tmp_path, cache):
    one, two = (design(bundle, ["dead_reckoning"], [t], 0)[1:] for t in TEXTS[:2])

    def fail():
        with (
            watched(cache, tmp_path / "R") as watch,
            Replayer(bundle, cache=cache / "runs", watch=watch) as replayer,
        ):
            replayer.replay(one)
            replayer.replay(two)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    left = look(cache, tmp_path / "R")
    assert not left.is_running
    assert left.left_s is None
    assert [s.trial for s in left.trials] == [*one, *two]
    assert look(cache, tmp_path / "other") is None


def test_one_output_is_made_by_one_command_at_a_time(tmp_path):
    with watched(tmp_path, tmp_path / "R") as first, watched(tmp_path, tmp_path / "R") as second:
        assert first is not None
        assert second is None
        with watched(tmp_path, tmp_path / "S") as other:
            assert other is not None


def test_a_half_written_or_foreign_file_is_nothing(tmp_path):
    with watched(tmp_path, tmp_path / "R") as watch:
        trial = Trial("b", "amcl", 0)
        watch.tell(tmp_path, [TrialState(trial, "waiting")], None)
        (file,) = tmp_path.glob("*.json")
        whole = file.read_text()
        for text in (whole[: len(whole) // 2], "[]", '{"watch_format": 99}'):
            file.write_text(text)
            assert look(tmp_path, tmp_path / "R") is None
        file.write_text(whole)
        assert look(tmp_path, tmp_path / "R").trials[0].trial == trial


def test_time_left_runs_down_between_two_words(tmp_path, monkeypatch):
    with watched(tmp_path, tmp_path / "R") as watch:
        watch.tell(tmp_path, [TrialState(Trial("b", "amcl", 0), "running", 1.0)], 30.0)
        told_s = json.loads(next(tmp_path.glob("*.json")).read_text())["told_s"]

        for passed_s, left_s in ((10.0, 20.0), (50.0, 0.0)):
            monkeypatch.setattr(time, "time", lambda s=passed_s: told_s + s)
            assert look(tmp_path, tmp_path / "R").left_s == pytest.approx(left_s)


def test_after_a_kill_inspect_says_what_is_kept_and_the_command_goes_on(bundle, tmp_path, cache):
    arguments = ["perturb", str(bundle.path), "-o", str(tmp_path / "R"), "-e", "dead_reckoning"]
    for text in TEXTS:
        arguments += ["-p", text]
    with subprocess.Popen([sys.executable, "-m", "slamreplay.cli.main", *arguments]) as process:
        end = time.monotonic() + 60.0
        while time.monotonic() < end and len(list((cache / "runs").glob("*.npz"))) < 3:
            time.sleep(0.02)
        process.kill()

    left = inspected(tmp_path / "R")
    assert left["state"] == "interrupted"
    assert not (tmp_path / "R").exists()
    done = [row for row in left["trials"] if row["state"] == "done"]
    assert 0 < len(done) < len(TEXTS)
    assert done[0]["metrics"]["baseline_max_m"] == 0.0
    assert "kept; the same command goes on from there" in run("inspect", tmp_path / "R")
    before = {f.name: f.stat().st_mtime_ns for f in (cache / "runs").glob("*.npz")}

    run(*arguments)

    after = {f.name: f.stat().st_mtime_ns for f in (cache / "runs").glob("*.npz")}
    assert {name: after[name] for name in before} == before
    finished = inspected(tmp_path / "R")
    assert finished["state"] == "finished"
    assert [row["level"] for row in finished["trials"][1:]] == [k / 1000 for k in range(1, 41)]
    assert "finished, 41 of 41 trials done" in run("inspect", tmp_path / "R")


def test_what_is_not_applicable_is_told_beside_its_trial(bundle, tmp_path):
    run("perturb", bundle.path, "-o", tmp_path / "R", "-e", "dead_reckoning", "-p",
        "initial_pose.global=1")  # fmt: skip

    lines = run("inspect", tmp_path / "R").splitlines()

    assert "not applicable: " in lines[-1]
    assert lines[-1].index("not applicable") < 80
