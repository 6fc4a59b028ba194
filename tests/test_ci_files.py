"""The action, the workflow and the GitLab job of recipes/ci-gate.

Validated against the schemas that the package check-jsonschema carries (github-actions.json,
github-workflows.json, gitlab-ci.json); their shell runs here with a program that only writes down
how it was called.
"""

import functools
import json
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import files

import jsonschema
import pytest
import yaml
from ci_rules import code_quality, commands, junit, sarif
from conftest import ROOT

_RUN = {
    "GITHUB_SERVER_URL": "https://github.example",
    "GITHUB_REPOSITORY": "o/r",
    "GITHUB_RUN_ID": "7",
}
CI_GATE = ROOT / "recipes" / "ci-gate"
_PROGRAM = """#!{python}
import json, os, sys
from pathlib import Path
called = [Path(sys.argv[0]).name, *sys.argv[1:]]
with Path(os.environ["CALLS"]).open("a") as calls:
    calls.write(json.dumps(called) + "\\n")
if "-o" in sys.argv:
    folder = Path(sys.argv[sys.argv.index("-o") + 1])
    folder.mkdir(exist_ok=True)
    (folder / "gate.sarif").write_text("{{}}")
sys.exit(int(os.environ.get("ENDS", "0")))
"""


def read(name):
    text = (CI_GATE / name).read_text(encoding="utf-8")
    # GitHub's keys are strings: "on" is none of YAML 1.1's truths.
    return yaml.load(re.sub(r"^on:", '"on":', text, flags=re.MULTILINE), yaml.SafeLoader)


@functools.cache
def schema(name):
    kept = (path for path in files("check-jsonschema") if path.name == name)
    return json.loads(next(kept).locate().read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("name", "by"),
    [
        ("action.yml", "github-actions.json"),
        ("github-workflow.yml", "github-workflows.json"),
        ("gitlab-ci.yml", "gitlab-ci.json"),
    ],
)
def test_files_keep_the_schemas_of_their_makers(name, by):
    validator = jsonschema.validators.validator_for(schema(by))(schema(by))

    assert [error.message for error in validator.iter_errors(read(name))] == []


def test_what_the_workflow_gives_the_action_takes():
    (step,) = [
        step
        for step in read("github-workflow.yml")["jobs"]["gate"]["steps"]
        if "ci-gate" in step["uses"]
    ]
    inputs = read("action.yml")["inputs"]

    assert set(step["with"]) <= set(inputs)
    assert {name for name, told in inputs.items() if told.get("required")} <= set(step["with"])


def steps():
    return {step["name"]: step for step in read("action.yml")["runs"]["steps"]}


def test_no_input_is_part_of_a_steps_text():
    runs = [step["run"] for step in steps().values() if "run" in step]

    assert len(runs) == 3
    assert not any("${{" in run for run in runs)


class Job:
    """A folder with the environment of a GitHub runner, where steps of the action run."""

    def __init__(self, folder):
        self.folder = folder
        for name in ("bin", "temp", "work", "action/recipes/ci-gate"):
            (folder / name).mkdir(parents=True)
        for name in ("output", "summary", "path", "calls"):
            (folder / name).touch()
        self.program("slamreplay")
        self.values = {
            f"inputs.{name}": told.get("default", "")
            for name, told in read("action.yml")["inputs"].items()
        }
        self.values["github.action_path"] = str(folder / "action/recipes/ci-gate")

    def program(self, name, text=_PROGRAM):
        path = self.folder / "bin" / name
        path.write_text(text.format(python=sys.executable))
        path.chmod(0o755)

    def run(self, name, **variables):
        step = steps()[name]
        given = {
            key: re.sub(r"\$\{\{ (.*?) \}\}", lambda found: self.values[found[1]], value)
            for key, value in step["env"].items()
        }
        return self.shell(step["run"], **given, **variables)

    def shell(self, script, *, folder="work", **variables):
        assert subprocess.run(["bash", "-n", "-c", script], check=False).returncode == 0
        environment = {
            "PATH": f"{self.folder / 'bin'}:{os.environ['PATH']}",
            "LC_ALL": "C",  # the order of globs
            "RUNNER_TEMP": str(self.folder / "temp"),
            "GITHUB_OUTPUT": str(self.folder / "output"),
            "GITHUB_STEP_SUMMARY": str(self.folder / "summary"),
            "GITHUB_PATH": str(self.folder / "path"),
            "CALLS": str(self.folder / "calls"),
            **variables,
        }
        return subprocess.run(
            ["bash", "--noprofile", "--norc", "-euo", "pipefail", "-c", script],
            cwd=self.folder / folder, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip

    @property
    def calls(self):
        return [json.loads(line) for line in (self.folder / "calls").read_text().splitlines()]

    @property
    def outputs(self):
        lines = (self.folder / "output").read_text().splitlines()
        return dict(line.split("=", 1) for line in lines)

    def judge(self, logs, ends=0, **inputs):
        for path in ("a.mcap", "b c.mcap", "deep/er/d.mcap", "-x.mcap"):
            (self.folder / "work" / path).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / "work" / path).touch()
        self.values |= {"inputs.logs": logs, "inputs.recipe": "ci/gate.yaml"}
        self.values |= {f"inputs.{name}": value for name, value in inputs.items()}
        return self.run("Judge the logs", ENDS=str(ends))


@pytest.fixture
def job(tmp_path):
    return Job(tmp_path)


def test_logs_are_globs_and_everything_else_is_taken_as_it_is(job):
    done = job.judge(
        "*.mcap\n**/d.mcap\n",
        baseline="ci/b l.json",
        arguments="--map\nm $(touch pwned).yaml",
        output="out $(touch pwned)",
    )

    assert (done.returncode, done.stderr) == (0, "")
    assert job.calls == [[
        "slamreplay", "gate", "--recipe", "ci/gate.yaml", "-o", "out $(touch pwned)", "--github",
        "--baseline", "ci/b l.json", "--map", "m $(touch pwned).yaml",
        "--", "-x.mcap", "a.mcap", "b c.mcap", "deep/er/d.mcap",
    ]]  # fmt: skip
    assert job.outputs == {"exit-code": "0", "sarif": "true"}
    assert not list(job.folder.rglob("pwned"))


def test_a_glob_may_hold_a_blank(job):
    assert job.judge("b c.*").returncode == 0
    assert job.calls[0][-2:] == ["--", "b c.mcap"]


@pytest.mark.parametrize("code", [0, 1, 2, 70])
def test_a_gate_that_fails_goes_on_to_the_uploads(job, code):
    assert job.judge("a.mcap", ends=code).returncode == 0
    assert job.outputs["exit-code"] == str(code)


@pytest.mark.parametrize(("ends", "code"), [(1, "2"), (70, "70")])
def test_a_glob_that_nothing_fits_is_an_error_and_stops_no_other(job, ends, code):
    done = job.judge("none/*.mcap%0A\na.mcap", ends=ends)

    assert done.returncode == 0
    assert done.stdout == "::error title=slamreplay gate::no log fits none/*.mcap%250A\n"
    assert job.calls[0][-1] == "a.mcap"
    assert job.outputs["exit-code"] == code


def test_without_logs_nothing_is_judged(job):
    assert "no logs are named" in job.judge("\n").stdout
    assert (job.calls, job.outputs) == ([], {"exit-code": "2"})


@pytest.mark.parametrize(
    ("fail_on", "code", "ends"),
    [
        *(("failure", code, int(code)) for code in ("0", "1", "2", "70")),
        ("unreadable", "1", 0), ("unreadable", "2", 2), ("unreadable", "70", 70),
        ("never", "1", 0), ("never", "2", 0), ("never", "70", 70),
        ("failure", "", 70), ("never", "", 70), ("warning", "1", 2), ("", "1", 2),
    ],
)  # fmt: skip
def test_the_last_step_ends_as_the_gate_did(job, fail_on, code, ends):
    job.values |= {"inputs.fail-on": fail_on, "steps.gate.outputs.exit-code": code}

    assert job.run("Pass or fail").returncode == ends


def test_the_action_runs_the_gate_itself(job):
    """With the program, on a sample log: what it leaves for the uploads keeps the rules."""
    job.program("slamreplay", '#!/bin/sh\nexec {python} -m slamreplay.cli.main "$@"\n')
    work = job.folder / "work"
    shutil.copy(ROOT / "sample_logs" / "healthy_short.bag", work / "a log.bag")
    (work / "broken.bag").write_bytes(b"::error::no log")
    (work / "gate.yaml").write_text(
        "version: 1\nquestion: Does it?\nexpect: [state=healthy]\nlimits: {error_max_m: 0.001}\n"
    )
    job.values |= {
        "inputs.logs": "*.bag",
        "inputs.recipe": "gate.yaml",
        "inputs.arguments": "--no-cause",
    }

    done = job.run("Judge the logs", PYTHONPATH=str(ROOT), **_RUN)

    assert (done.returncode, job.outputs) == (0, {"exit-code": "2", "sarif": "true"})
    out = work / "gate"
    texts = {path.name: path.read_text() for path in out.iterdir() if path.is_file()}
    assert junit(texts["junit.xml"]).get("failures") == "1"
    found = sarif(texts["gate.sarif"])["results"]
    assert [one["ruleId"] for one in found] == ["read", "limit/error_max_m"]
    assert [one["location"]["path"] for one in code_quality(texts["gl-code-quality.json"])] == [
        "broken.bag", "a log.bag",
    ]  # fmt: skip
    stopped, told = done.stdout.split("\n", 1)
    told = told.split(f"::{stopped.split('::')[2]}::\n")[1]
    assert [given["file"] for _, given, _ in commands(told.rsplit("\n", 2)[0])] == [
        "broken.bag", "a log.bag",
    ]  # fmt: skip
    summary = (job.folder / "summary").read_text()
    assert "https://github.example/o/r/actions/runs/7#artifacts" in summary
    assert (out / "logs" / "a_log" / "report.html").is_file()


_PYTHON3 = """#!/bin/bash
# python3 -m venv FOLDER, which brings a python for pip and a uv
mkdir -p "$3/bin"
cp "$(dirname "$0")/slamreplay" "$3/bin/python"
cp "$(dirname "$0")/slamreplay" "$3/bin/uv"
"""


@pytest.mark.parametrize("locked", [True, False])
def test_it_installs_what_it_came_with_or_what_it_is_told(job, locked):
    job.program("python3", _PYTHON3)
    (job.folder / "action" / "uv.lock").touch()
    package = "git+https://git.example/s@v1 $(touch pwned)"
    job.values["inputs.package"] = "" if locked else package

    done = job.run("Install slamreplay")

    home = job.folder / "temp" / "slamreplay"
    assert (done.returncode, done.stderr) == (0, "")
    assert job.calls[0] == ["python", "-m", "pip", "install", "--quiet", "uv"]
    if locked:
        assert job.calls[1][:2] == ["uv", "sync"]
        assert job.calls[1][-2:] == ["--project", f"{job.folder}/action/recipes/ci-gate/../.."]
        assert "--frozen" in job.calls[1]
    else:
        assert job.calls[1][:2] == ["uv", "venv"]
        assert job.calls[2][:3] == ["uv", "pip", "install"]
        assert job.calls[2][-2:] == ["--", package]
    assert (job.folder / "path").read_text() == f"{home}/env/bin\n"


def test_the_action_is_two_folders_below_the_project():
    assert (CI_GATE / ".." / ".." / "uv.lock").is_file()
    assert read("action.yml")["runs"]["steps"][2]["if"].startswith("${{ always()")


@pytest.mark.parametrize("shell", ["bash", "dash"])
@pytest.mark.parametrize("baseline", ["", "ci/b l.json"])
def test_the_gitlab_job_judges_all_logs(job, shell, baseline):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell}")
    told = read("gitlab-ci.yml")["localization-gate"]
    program = job.folder / "work" / ".slamreplay" / "bin" / "slamreplay"
    program.parent.mkdir(parents=True)
    shutil.copy(job.folder / "bin" / "slamreplay", program)
    for name in ("a.mcap", "b c.mcap"):
        (job.folder / "work" / "logs $(touch pwned)" / name).parent.mkdir(exist_ok=True)
        (job.folder / "work" / "logs $(touch pwned)" / name).touch()
    variables = told["variables"] | {
        "GATE_LOGS": "logs $(touch pwned)/*.mcap",
        "GATE_BASELINE": baseline,
    }
    lines = "\n".join(told["script"]).replace("'", "'\\''")

    done = job.shell(f"{shell} -eu -c '{lines}'", ENDS="1", **variables)

    assert (done.returncode, done.stderr) == (1, "")
    given = ["--baseline", baseline] if baseline else []
    logs = [f"logs $(touch pwned)/{name}" for name in ("a.mcap", "b c.mcap")]
    assert job.calls == [
        ["slamreplay", "gate", "--recipe", "ci/gate.yaml", *given, "-o", "gate", "--", *logs]
    ]
    kept = told["artifacts"]["reports"]
    assert kept == {"junit": "gate/junit.xml", "codequality": "gate/gl-code-quality.json"}
    assert not list(job.folder.rglob("pwned"))
