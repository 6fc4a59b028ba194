"""The README is true: what it lists is there, what it shows runs, what it links to exists."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
import typer

from slamreplay.bundle.findings import FINDINGS
from slamreplay.bundle.role_tables import ROLE_TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.cli import main
from slamreplay.estimators import ESTIMATORS
from slamreplay.export.formats import Format
from slamreplay.ingest.overrides import FRAME_KEYS
from slamreplay.perturb import PERTURBATIONS, VARIANTS
from slamreplay.report.model import Report
from slamreplay.testing.synthetic import room_grid, synthetic_bundle
from slamreplay.verdict.judgement import STATES

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
TEXT = README.read_text(encoding="utf-8")
PAGES = (README, ROOT / "tests" / "benchmarks" / "README.md")


def between(start, end):
    return TEXT.split(start, 1)[1].split(end, 1)[0]


def block(mark):
    """The code below a mark."""
    return re.search(rf"<!-- {re.escape(mark)} -->\n```\w+\n(.*?)```", TEXT, re.DOTALL)[1]


def first_cells(section):
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| ")]
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row)]


def test_findings_are_all_there():
    families = {}
    for id_, what in FINDINGS.items():
        family, _, number = id_.rpartition("-")
        families.setdefault(family, []).append(f"{number} {what.title}")
    rows = [f"| {family}- | {'; '.join(titles)} |" for family, titles in families.items()]
    table = "\n".join(["| finding | says |", "|---|---|", *rows])

    assert between("<!-- table: checks -->\n", "\n<!-- end of table -->") == table


def test_states_estimators_roles_and_keys_are_all_there():
    assert first_cells(between("## Reading the verdict", "`confidence`")) == list(STATES)
    assert set(first_cells(between("| key of report.json", "## "))) == set(Report.model_fields) - {
        "schema_version",
        "slamreplay",
    }
    estimators = between("## Estimators worth re-running", "Every estimator")
    assert set(ESTIMATORS) <= set(re.findall(r"`(\w+)`", estimators))
    roles = re.sub(r"\s+", " ", between("Roles: ", ";"))
    assert roles.split(", ") == list(ROLE_TABLES)
    assert all(f"`{key}`" in TEXT for key in FRAME_KEYS)


def test_export_formats_are_all_there():
    told = first_cells(between("## Into the tools you have", "## Is the covariance"))

    assert {str(one) for one in Format} <= {name.split()[0] for name in told}


def test_counts_of_perturbations():
    variants = sum(len(PERTURBATIONS.load(name).variants) for name in VARIANTS)

    assert f"# {len(VARIANTS)} in {variants} variants" in TEXT


def test_every_recipe_is_named():
    for recipe in sorted((ROOT / "recipes").iterdir()):
        assert f"](recipes/{recipe.name}/README.md)" in TEXT


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.parent.name)
def test_links_and_pictures_exist(page):
    text = page.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)]+)\)", text)

    assert links
    for link in links:
        path, _, anchor = link.partition("#")
        target = page.parent / path
        assert target.exists(), link
        if anchor:
            heads = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in [head.lower().replace(" ", "-") for head in heads], link


def test_the_layers_are_those_of_the_linter():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (contract,) = settings["tool"]["importlinter"]["contracts"]
    there = [
        [name for name in re.findall(r"slamreplay\.(\w+)", layer) if _exists(name)]
        for layer in contract["layers"]
    ]
    shown = " ".join(between("kept by a linter in CI:\n\n```\n", "```").split())

    assert [layer.split(" | ") for layer in shown.split(" > ")] == there


def _exists(name):
    return any((ROOT / "slamreplay" / leaf).exists() for leaf in (name, f"{name}.py"))


def test_names_in_the_table_of_conventions_exist():
    table = between("## Conventions", "## How it is built")
    names = [n for n in re.findall(r"`([a-z_]+(?:\.\w+)+)`", table) if "." in n]
    names = [n for n in names if not n.endswith(".pgm")]

    assert len(names) > 10
    for name in names:
        module, thing = f"slamreplay.{name}", None
        parts = []
        while thing is None:
            try:
                thing = import_module(module)
            except ModuleNotFoundError:
                module, _, last = module.rpartition(".")
                parts.insert(0, last)
        for part in parts:
            thing = getattr(thing, part)


def commands():
    """Name of each command to its options."""
    found = {}
    for name in main.COMMANDS:
        program = typer.Typer()
        import_module(f"slamreplay.cli.{name}").register(program)
        program.callback()(lambda: None)
        for key, command in typer.main.get_command(program).commands.items():
            leaves = getattr(command, "commands", {key: command}).values()
            found[key] = {
                o for leaf in leaves for p in leaf.params for o in (*p.opts, *p.secondary_opts)
            }
    return found


def test_commands_and_options_exist():
    known = commands()
    code = re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL)
    shown = re.findall(r"`(slamreplay [^`]+)`", TEXT) + [x for b in code for x in b.splitlines()]
    used = [line.split("#")[0] for line in shown if re.search(r"(^| )slamreplay [a-z]", line)]

    assert len(used) > 12
    for line in used:
        _, _, rest = line.partition("slamreplay ")
        command, *words = rest.replace(r"\|", "|").split()
        assert command in known, line
        options = [w.partition("=")[0] for w in words if re.fullmatch(r"--?[a-z][\w-]*(=.*)?", w)]
        assert set(options) <= known[command], line
    every = set.union(*known.values()) | {"--debug", "--install-completion"}
    prose = re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL)
    assert set(re.findall(r"`(--[a-z-]+)", prose)) <= every
    assert set(known) <= {line.split("slamreplay ")[1].split()[0].strip("`,") for line in used}


def test_the_example_for_notebooks_runs(tmp_path):
    code = block("example: notebook")
    code = code.replace('"my_robot.mcap", map="my_map.yaml"', "log, cause=False")
    told = {"log": write_bundle_of_a_room(tmp_path / "b.bundle")}

    exec(compile(code, str(README), "exec"), told)

    assert told["r"].verdict.state == "lost"


def write_bundle_of_a_room(target):
    bundle = synthetic_bundle(seconds=6.0, belief_offset_xyyaw=(1.5, 0.5, 0.1))
    names = ("scans", "odometry", "transforms", "poses", "initial_poses", "references")
    tables = {name: bundle.table(name) for name in names}
    write_bundle(target, bundle.manifest, tables, {"room": room_grid()})
    return target


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """The README's examples as somebody's installed package."""
    folder = tmp_path_factory.mktemp("plugin")
    for name in ("my_robot.py", "test_my_robot.py"):
        (folder / name).write_text(block(f"example: {name}"), encoding="utf-8")
    groups = tomllib.loads(block("example: pyproject.toml"))["project"]["entry-points"]
    about = folder / "my_robot-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my_robot\nVersion: 1.0\n")
    lines = [f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in names.items())
             for group, names in groups.items()]  # fmt: skip
    (about / "entry_points.txt").write_text("\n".join(lines))
    return folder


def run(plugin, *arguments):
    path = os.pathsep.join([str(plugin), str(ROOT)])
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=plugin,
        env=os.environ | {"PYTHONPATH": path, "NUMBA_NUM_THREADS": "1"},
        timeout=240,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_examples_keep_the_contract(plugin):
    arguments = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:dash")
    assert "1 passed" in run(plugin, *arguments, "test_my_robot.py")


def test_examples_are_found_and_run_as_somebody_elses_package(plugin):
    program = ("-m", "slamreplay.cli.main")
    names = {
        kind: {
            row["name"]: row["doc"]
            for row in json.loads(run(plugin, *program, "list", kind, "--json"))
        }
        for kind in ("estimators", "perturbations", "decoders", "checks")
    }
    log = shutil.copy(ROOT / "sample_logs" / "healthy_short.bag", plugin / "log.bag")
    told = run(plugin, *program, "perturb", log, "-e", "wheels", "-o", plugin / "runs", "--json")

    assert names["estimators"]["wheels"].startswith("Odometry as it was told")
    assert names["perturbations"]["range_steps.size"] == "ranges are multiples of this"
    assert names["decoders"]["my_msgs/msg/Bumper"] == "to table health"
    assert names["checks"]["too_sure"].startswith("Name a belief")
    (trial,) = json.loads(told)["trials"]
    assert trial["metrics"]["rows_with_pose"] > 100
