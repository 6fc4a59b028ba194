"""Shell completion by its real protocol: commands, options and values, and nothing heavy loaded."""

import json
import os
import subprocess
import sys

import pytest
from heavy_modules import HEAVY

from slamreplay.bundle.findings import FINDINGS, SEVERITIES
from slamreplay.bundle.view import SENSED_KINDS
from slamreplay.catalogue import KINDS
from slamreplay.cli.completion import HELD_OUT
from slamreplay.estimators import ESTIMATORS
from slamreplay.perturb import PERTURBATIONS, VARIANTS
from slamreplay.simulate import SCENARIOS

PROGRAM = (
    "import atexit, json, sys\n"
    "atexit.register(lambda: print(json.dumps(sorted(sys.modules)), file=sys.stderr))\n"
    "sys.argv = ['slamreplay']\n"
    "from slamreplay.cli.main import main\n"
    "main()"
)


def completed(line, cwd, shell="bash"):
    """What the shell is offered for the last word of a line, as its own script asks for it."""
    words = line.split(" ")
    asked = {
        "_SLAMREPLAY_COMPLETE": f"complete_{shell}",
        "COMP_WORDS": "\n".join(words),
        "COMP_CWORD": str(len(words) - 1),
        "_TYPER_COMPLETE_ARGS": line,
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=os.environ | asked,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    loaded = {name.partition(".")[0] for name in json.loads(done.stderr.splitlines()[-1])}
    assert sorted(set(HEAVY) & loaded) == []
    return done.stdout.splitlines()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("slamreplay in", ["ingest", "inspect"]),
        ("slamreplay report --no-", ["--no-cause"]),
        ("slamreplay explain SR-", list(FINDINGS)),
        ("slamreplay list ", list(KINDS)),
        ("slamreplay simulate ", list(SCENARIOS)),
        ("slamreplay report LOG --fail-on ", list(SEVERITIES)),
        ("slamreplay report LOG --hold-out ", list(HELD_OUT)),
        ("slamreplay perturb LOG -e ", list(ESTIMATORS)),
        ("slamreplay perturb LOG -e ekf --estimator am", ["amcl"]),
        ("slamreplay perturb LOG -p tf_", ["tf_delay.odometry=", "tf_delay.all="]),
    ],
)
def test_bash_is_offered(tmp_path, line, offered):
    assert completed(line, tmp_path) == offered


def test_recipes_of_the_folder_are_offered(request):
    offered = completed("slamreplay perturb --recipe recipes/w", request.config.rootpath)

    assert offered == ["recipes/wheel-slip/recipe.yaml"]


def test_zsh_and_fish_are_told_what_names_mean(tmp_path):
    assert "The robot was lost" in completed("slamreplay explain SR-LOC-001", tmp_path, "zsh")[0]


def test_what_is_offered_without_loading_it_is_what_there_is():
    assert {name: tuple(PERTURBATIONS.load(name).variants) for name in VARIANTS} == VARIANTS
    assert set(VARIANTS) <= set(PERTURBATIONS)
    assert set(HELD_OUT) == set(SENSED_KINDS)


def test_the_script_for_the_shell_is_printed():
    done = subprocess.run(
        [sys.executable, "-m", "slamreplay.cli.main", "--show-completion", "bash"],
        capture_output=True,
        text=True,
        timeout=60,
    )

    assert "_COMPLETE=complete_bash" in done.stdout
