"""`slamreplay gate` as users call it: exit codes, files, and what is said."""

import json
import os
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from posts import lost_post

from slamreplay.bundle.findings import Finding
from slamreplay.cli import gate_run
from slamreplay.cli.gate import gate
from slamreplay.cli.gate_run import Gating, judged
from slamreplay.errors import LogError, OutputError, UsageError
from slamreplay.gate.baseline import Baseline, kept_log
from slamreplay.gate.gated import gated
from slamreplay.gate.measures import Measure, Measures
from slamreplay.gate.measuring import measures_of
from slamreplay.gate.outcome import GateResult, Outcome
from slamreplay.gate.result_file import gate_json
from slamreplay.gate.rules import Demands, Limit, Rules
from slamreplay.ingest.options import IngestOptions
from slamreplay.recipes import read_recipe

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = str(Path(sys.executable).with_name("slamreplay"))
DESIGN = ROOT / "recipes" / "ci-gate" / "recipe.yaml"
SAMPLES = ROOT / "recipes" / "ci-gate" / "gate.yaml"

RECIPE = """\
version: 1
question: Does it still fare as it must?
expect: [state=healthy]
forbid: [SR-LOC-*]
limits:
  error_max_m: 0.5
  error_m: {max: 0.02, for_s: 2}
  nees_factor: 2
  dead_reckoning.error_max_m: 100
estimators: [dead_reckoning]
"""


def run(*arguments, **env):
    return subprocess.run(
        [PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=600,
        cwd=ROOT,
        env=os.environ | env,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("gate")
    (out / "gate.yaml").write_text(RECIPE, encoding="utf-8")
    return out


@pytest.fixture(scope="module")
def done(folder):
    """One log that fails a limit, one that is not there."""
    return run(
        "gate", "sample_logs/healthy_short.bag", "sample_logs/gone.mcap", "--no-cause",
        "--recipe", folder / "gate.yaml", "-o", folder / "out",
        "--junit", folder / "j.xml", "--sarif", folder / "s.sarif", "--gitlab", folder / "g.json",
        "--github", GITHUB_STEP_SUMMARY=str(folder / "summary.md"), GITHUB_RUN_ID="",
    )  # fmt: skip


def test_a_log_that_is_not_there_does_not_stop_the_others(done, folder):
    told = json.loads((folder / "out" / "gate.json").read_text(encoding="utf-8"))

    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert [(log["log"], log["status"]) for log in told["logs"]] == [
        ("sample_logs/healthy_short.bag", "failed"),
        ("sample_logs/gone.mcap", "error"),
    ]
    assert (told["schema_version"], told["exit_code"]) == (1, 2)
    assert told["checks"]["failed"] == 1


def test_checks_have_the_numbers_of_the_log(done, folder):
    (log, _) = json.loads((folder / "out" / "gate.json").read_text(encoding="utf-8"))["logs"]
    checks = {one["check"]: one for one in log["outcomes"]}
    report = json.loads(
        (folder / "out" / log["report"] / "report.json").read_text(encoding="utf-8")
    )

    assert log["state"] == report["verdict"]["state"] == "healthy"
    assert checks["expect/state=healthy"]["status"] == "passed"
    assert checks["forbid/SR-LOC-001"]["status"] == "passed"
    assert checks["limit/error_max_m"]["value"] == pytest.approx(
        max(interval["max_error_m"] for interval in report["intervals"])
    )
    (trial,) = report["trials"]
    assert checks["limit/dead_reckoning.error_max_m"]["value"] == pytest.approx(
        trial["metrics"]["hindsight_max_m"]
    )
    failed = checks["limit/error_m"]
    assert (failed["status"], failed["limit"]) == ("failed", 0.02)
    assert failed["end_ns"] - failed["start_ns"] >= 2_000_000_000
    skipped = checks["limit/nees_factor"]
    assert skipped["status"] == "skipped"
    assert "independent" in skipped["message"]


def test_every_file_is_there_and_can_be_parsed(done, folder):
    out = folder / "out"

    assert {path.name for path in out.iterdir()} == {
        "gate.json", "baseline.json", "junit.xml", "gate.sarif", "gl-code-quality.json",
        "summary.md", "logs",
    }  # fmt: skip
    cases = ET.parse(out / "junit.xml").getroot().findall(".//testcase")
    checks = json.loads((out / "gate.json").read_text(encoding="utf-8"))["checks"]
    assert len(cases) == sum(checks.values())
    assert json.loads((out / "gate.sarif").read_text(encoding="utf-8"))["version"] == "2.1.0"
    same_files = {
        "j.xml": "junit.xml",
        "s.sarif": "gate.sarif",
        "g.json": "gl-code-quality.json",
        "summary.md": "summary.md",
    }
    for name, same in same_files.items():
        assert (folder / name).read_bytes() == (out / same).read_bytes()


def test_it_says_what_failed_worst_first_and_ends_with_the_path(done, folder):
    lines = done.stdout.splitlines()

    assert "Does it still fare as it must?" in lines
    assert any("healthy_short.bag" in line and "FAILED" in line for line in lines)
    first, second = (
        next(k for k, line in enumerate(lines) if line.startswith("! ") and name in line)
        for name in ("gone.mcap", "limit/error_m at ")
    )
    assert first < second
    assert "above 0.02 m for" in lines[second + 1]
    assert any("limit/nees_factor skipped" in line for line in lines)
    assert lines[-1] == str(folder / "out" / "gate.json")
    # GitHub takes commands from the last lines only, not from what a log may have put above.
    taken = [k for k, line in enumerate(lines) if line.startswith("::")]
    assert lines[taken[0]].startswith("::stop-commands::")
    assert lines[taken[1]] == f"::{lines[taken[0]].split('::')[2]}::"
    assert [lines[k][:8] for k in taken[2:]] == ["::error "] * 2
    assert first > taken[0]
    assert taken[1:] == list(range(len(lines) - 4, len(lines) - 1))
    assert "1 of 2: sample_logs/healthy_short.bag: failed" in done.stderr


def test_it_is_the_same_the_next_time_and_compared_with_the_last(done, folder):
    again = run(
        "gate", "sample_logs/healthy_short.bag", "--recipe", folder / "gate.yaml", "--no-cause",
        "--baseline", folder / "out" / "baseline.json", "--json",
    )  # fmt: skip
    told = json.loads(again.stdout)
    first = json.loads((folder / "out" / "gate.json").read_text(encoding="utf-8"))["logs"][0]
    (log, together) = told["logs"]
    compared = [one for one in log["outcomes"] if one["check"].startswith("baseline/")]

    assert again.returncode == 1
    assert [one for one in log["outcomes"] if one not in compared] == first["outcomes"]
    assert log["measures"] == first["measures"]
    assert compared
    assert together["log"] == (folder / "out" / "baseline.json").as_posix()
    assert {one["status"] for one in (*compared, *together["outcomes"])} <= {"passed", "skipped"}


def test_a_design_and_a_gate_say_which_command_takes_them(folder):
    with pytest.raises(UsageError, match="slamreplay perturb --recipe"):
        gate([Path("a")], DESIGN)
    told = run("perturb", "--recipe", folder / "gate.yaml", "-o", folder / "no")

    assert told.returncode == 2
    assert "slamreplay gate LOG... --recipe" in told.stderr
    assert len(told.stderr.splitlines()) == 1


def test_mistakes_are_told_before_any_work(folder, monkeypatch):
    monkeypatch.setattr(gate_run, "judged", lambda *_: pytest.fail("work was done"))
    recipe = folder / "gate.yaml"
    (folder / "foreign").mkdir(exist_ok=True)
    (folder / "foreign" / "mine.txt").touch()
    log = Path("a.mcap")

    for said, error, how in (
        ("named twice", UsageError, {"logs": [log, Path("./a.mcap")]}),
        ("both print on stdout", UsageError, {"as_json": True, "github": True}),
        ("holds no gate.json", OutputError, {"output": folder / "foreign"}),
        ("its folder is not there", OutputError, {"junit": folder / "no" / "j.xml"}),
        ("is a folder", OutputError, {"sarif": folder}),
        ("cannot read the baseline", UsageError, {"baseline": folder / "no.json"}),
        ("cannot read the recipe", UsageError, {"recipe": folder / "no.yaml"}),
    ):
        with pytest.raises(error, match=said):
            gate(**{"logs": [log], "recipe": recipe, **how})


def gating(**how):
    demands = Demands("Is it?", Rules(expect=("state=lost",), max_severity=None))
    return Gating(demands, "gate.yaml", IngestOptions(), cause=False, baseline=None,
                  baseline_path="", **how)  # fmt: skip


def test_a_fault_of_ours_is_told_when_all_else_is_done(monkeypatch):
    post = lost_post()

    def looked_at(log, given, work, name):
        if log.name == "fault":
            raise ZeroDivisionError("on one\nlog")
        if log.name == "broken":
            raise LogError("it ends after 12 bytes", where=log)
        found = gated(post, given.demands, log.as_posix())
        return found, Measures(0, 1, {}), object()

    monkeypatch.setattr(gate_run, "_looked_at", looked_at)
    told = judged([Path("fault"), Path("broken"), Path("good")], gating(), None)

    assert [log.status for log in told.result.logs] == ["error", "error", "passed"]
    assert told.result.logs[0].summary == "a fault of ours: ZeroDivisionError: on one log"
    assert told.result.logs[1].summary == "broken: it ends after 12 bytes"
    assert isinstance(told.fault, ZeroDivisionError)
    monkeypatch.setattr(gate_run, "_looked_at", lambda *_: (_ for _ in ()).throw(OutputError("x")))
    with pytest.raises(OutputError):  # the next log would find no room either
        judged([Path("a"), Path("b")], gating(), None)


def test_a_limit_that_failed_in_the_baseline_must_be_clear(monkeypatch):
    """Whatever the log was called then."""
    post = lost_post()
    monkeypatch.setattr(gate_run.options, "evidence", lambda *_, **__: nullcontext())
    monkeypatch.setattr(gate_run, "postmortem", lambda *_, **__: post)
    limit = Limit("error_max_m", 2.0, clear=1.0)
    given = replace(gating(), demands=Demands("Is it?", Rules(max_severity=None, limits=(limit,))))
    kept = kept_log(measures_of(post), post.manifest.sources, "lost")

    def status(failed):
        baseline = Baseline({"old.mcap": replace(kept, failed=failed)})
        done = judged([Path("new.mcap")], replace(given, baseline=baseline), None)
        return done.result.logs[0].outcomes[0].status

    assert (status(()), status(("limit/error_max_m",))) == ("passed", "failed")


def test_reports_have_folders_of_their_own():
    names = gate_run._report_names(
        [Path("a/run.mcap"), Path("b/run.bag"), Path("..") / "x y.db3", Path("c/.."), Path("/")]
    )

    assert names[:3] == ["run", "run-2", "x_y"]
    assert len(set(names)) == 5
    assert all(name and "/" not in name and not name.startswith(".") for name in names)


def test_the_file_takes_what_a_log_says_and_numbers_that_are_none():
    outcome = Outcome("forbid/x\x00", "\ud800", "failed", "error", "\x1b[31m", value=np.inf)
    post = lost_post()
    log = gated(post, Demands("Is it?", Rules()), "a\x07.mcap")
    odd = type(log)(log.log, log.state, "\x00", 0, (outcome,))
    measures = {log.log: Measures(0, 1, {"ekf.error_max_m": Measure(np.inf, "m")}, {}, {"x": "y"})}
    text = gate_json(GateResult("Is it?", "g.yaml", (odd,)), measures)

    (told,) = json.loads(text)["logs"]
    assert told["outcomes"][0]["value"] is None
    assert told["measures"]["ekf.error_max_m"]["value"] is None
    assert "\x00" not in text
    assert text.isascii()


def test_rules_of_no_log_are_told(folder, capsys, monkeypatch):
    from slamreplay.cli.gate import _warn_of_patterns

    demands = read_recipe(SAMPLES).demands
    _warn_of_patterns(demands, ["sample_logs/lost_robot.mcap", "sample_logs/wheel_slip.mcap"])

    assert capsys.readouterr().err.splitlines() == [
        "the recipe's rules of 'lost_in_changed_aisle*' are of none of these logs",
        "the recipe's rules of 'changed_aisle*' are of none of these logs",
    ]


def test_the_recipe_of_the_samples_names_each_of_them():
    """Their verdicts are those that sample_logs/README.md promises."""
    demands = read_recipe(SAMPLES).demands
    promised = {
        line.split("|")[1].strip(): line.split("|")[4].strip()
        for line in (ROOT / "sample_logs" / "README.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| ") and ".mcap" in line
    }

    assert len(promised) == 6
    for name, state in promised.items():
        assert f"state={state}" in demands.rules_of(f"sample_logs/{name}").expect


def test_findings_of_other_packages_may_be_demanded():
    """Where the recipe is read they are refused without their package; a worker takes them."""
    post = lost_post()
    rules = Rules(expect=("OTHER-7",), forbid=("OTHER-8",), max_severity=None)

    assert [one.status for one in gated(post, Demands("Is it?", rules), "a").outcomes] == [
        "passed",
        "passed",
    ]
    assert Finding("OTHER-7", "info", "").id
