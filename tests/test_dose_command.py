"""`slamreplay perturb --recipe` with a design: on a log, on a scenario, and with nonsense."""

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.cli import perturb
from slamreplay.errors import OutputError, UsageError
from slamreplay.replay.dose_file import read_doses
from slamreplay.replay.folder import read_runs
from slamreplay.testing.synthetic import synthetic_bundle

RECIPES = Path(__file__).parent.parent / "recipes"
DESIGN = """\
version: 1
question: How many scans can go missing?
seed: 3
seeds: 2
estimators: [amcl]
limits: {error_max_m: 0.5, error_max_deg: 20}
perturbations:
  - {name: scan_drop.random, levels_ratio: [0.5, 0.9]}
  - {name: initial_pose.offset, levels_m: [0.1, 3.0]}
"""
SCENARIO = "scenario: {name: healthy_short, seed: 1}\n"


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    made, path = synthetic_bundle(seconds=4.0), tmp_path_factory.mktemp("log") / "b"
    write_bundle(path, made.manifest, {name: made.table(name) for name in TABLES},
                 {"room": made.grid()})  # fmt: skip
    return path


@pytest.fixture(autouse=True)
def recipe(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "r.yaml").write_text(DESIGN)
    return tmp_path / "r.yaml"


def call(*arguments: object):
    app = typer.Typer()
    app.callback()(lambda: None)
    perturb.register(app)
    return CliRunner().invoke(app, ["perturb", *map(str, arguments)], catch_exceptions=True)


def test_a_design_is_answered_with_a_table_and_a_folder(bundle, recipe, tmp_path):
    ran = call(bundle, "--recipe", recipe, "-o", tmp_path / "R")

    assert ran.exit_code == 0, ran.exception
    lines = ran.stdout.splitlines()
    assert lines[0] == "How many scans can go missing?"
    (head,) = [k for k, line in enumerate(lines) if line.split()[:1] == ["perturbation"]]
    assert [line.split()[:3] for line in lines[head + 1 : head + 3]] == [
        ["scan_drop.random", "ratio", "amcl"],
        ["initial_pose.offset", "m", "amcl"],
    ]
    assert "3 [0.1 to 3; 50%]" in lines[head + 2]
    assert "seeds 3 to 4" in ran.stdout
    results = read_doses(tmp_path / "R")
    assert results.question == "How many scans can go missing?"
    assert len(read_runs(tmp_path / "R")[1]) == 1 + 4
    assert not (tmp_path / "R" / "bundle").exists()


def test_estimators_and_seed_of_the_command_line_go_before_the_recipe(bundle, recipe, tmp_path):
    ran = call(bundle, "--recipe", recipe, "-o", tmp_path / "R", "-e", "dead_reckoning",
               "--seed", "8", "--json")  # fmt: skip

    told = json.loads(ran.stdout)
    assert (told["estimators"], told["seeds"]) == (["dead_reckoning"], [8, 9])
    assert ran.stdout == (tmp_path / "R" / "results.json").read_text()
    assert told["results"]["curves"]["scan_drop.random"]["dead_reckoning"]["seeds"] == [8, 9]


def test_a_scenario_stands_for_the_log_and_its_bundle_is_kept(recipe, tmp_path):
    recipe.write_text(DESIGN.replace("estimators: [amcl]", SCENARIO + "estimators: [amcl]")
                      .replace("levels_ratio: [0.5, 0.9]", "levels_ratio: [0.5]")
                      .replace("seeds: 2", "seeds: 1"))  # fmt: skip

    ran = call("--recipe", recipe, "-o", tmp_path / "R", "-e", "dead_reckoning", "--json")

    assert json.loads(ran.stdout)["log"]["scenario"] == {"name": "healthy_short", "seed": 1}
    assert (tmp_path / "R" / "bundle").is_dir()
    assert read_runs(tmp_path / "R")[0].manifest.sources[0].name.endswith(".mcap")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["-p", "tf_delay=1"], "takes no --perturbation"),
        (["-e", "acml"], "did you mean 'amcl'"),
        (["-e", "amcl", "-e", "amcl"], "named twice"),
        (["--seed", "-1"], "negative"),
        (["--seed", str(2**63)], "too large"),
        (["--start", "1"], "takes no --map"),
    ],
)
def test_nonsense_is_refused_before_anything_is_run(bundle, recipe, tmp_path, arguments, says):
    ran = call(bundle, "--recipe", recipe, "-o", tmp_path / "R", *arguments)

    assert isinstance(ran.exception, UsageError)
    assert says in str(ran.exception)
    assert not (tmp_path / "R").exists()


@pytest.mark.parametrize("name", ["latency-budget", "wheel-slip", None])
@pytest.mark.parametrize(("seed", "says"), [(-1, "negative"), (2**62, "too large")])
def test_every_kind_of_question_refuses_the_same_seeds(bundle, tmp_path, name, seed, says):
    asked = [bundle] if name is None else ["--recipe", RECIPES / name / "recipe.yaml"]

    ran = call(*asked, "-o", tmp_path / "R", "--seed", seed)

    assert isinstance(ran.exception, UsageError)
    assert says in str(ran.exception)
    assert not (tmp_path / "R").exists()


def test_no_log_and_no_scenario(recipe, tmp_path):
    ran = call("--recipe", recipe, "-o", tmp_path / "R")

    assert "name one, or a scenario in the recipe" in str(ran.exception)


def test_a_simulated_log_takes_no_options_of_a_real_one(recipe, tmp_path):
    recipe.write_text(DESIGN + SCENARIO)

    ran = call("--recipe", recipe, "-o", tmp_path / "R", "--start", "1")

    assert "a simulated log takes no --map" in str(ran.exception)


def test_somebody_elses_folder_is_refused_before_any_work(bundle, recipe, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years of work")

    ran = call(bundle, "--recipe", recipe, "-o", tmp_path / "mine")

    assert isinstance(ran.exception, OutputError)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]
