"""`report`, `explain` and `list` on the command line."""

import json
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from slamreplay.bundle.findings import FINDINGS
from slamreplay.bundle.store import write_bundle
from slamreplay.cli import explain, list_, report
from slamreplay.errors import OutputError, UsageError
from slamreplay.perturb import PERTURBATIONS
from slamreplay.report.figures.panels import PANELS
from slamreplay.testing.synthetic import room_grid, synthetic_bundle


@pytest.fixture(scope="module")
def app():
    program = typer.Typer()

    @program.callback()
    def _root() -> None:
        pass

    for command in (report, explain, list_):
        command.register(program)
    return program


@pytest.fixture(scope="module")
def bundle_folder(tmp_path_factory):
    bundle = synthetic_bundle(seconds=6.0, belief_offset_xyyaw=(1.5, 0.5, 0.1))
    target = tmp_path_factory.mktemp("bundles") / "b.bundle"
    names = ("scans", "odometry", "transforms", "poses", "initial_poses", "references")
    tables = {name: bundle.table(name) for name in names}
    write_bundle(target, bundle.manifest, tables, {"room": room_grid()})
    return target


def run(app, *arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=True)


def test_report_of_a_bundle_ends_with_the_pages_path(app, bundle_folder, tmp_path):
    result = run(app, "report", bundle_folder, "-o", tmp_path / "r")

    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0].startswith("lost")
    assert lines[-1] == str(tmp_path / "r" / "report.html")
    assert (tmp_path / "r" / "report.json").exists()


def test_json_on_stdout_is_the_file_and_fail_on_is_the_exit_code(app, bundle_folder, tmp_path):
    result = run(app, "report", bundle_folder, "-o", tmp_path / "r", "--json", "--fail-on", "error")

    assert result.exit_code == 1
    assert result.stdout == (tmp_path / "r" / "report.json").read_text(encoding="utf-8")
    assert json.loads(result.stdout)["verdict"]["state"] == "lost"


def test_unknown_severity_is_refused_before_any_work(app, bundle_folder, tmp_path):
    result = run(app, "report", bundle_folder, "-o", tmp_path / "r", "--fail-on", "worry")

    assert isinstance(result.exception, UsageError)
    assert "info, warning, error" in str(result.exception)
    assert not list(tmp_path.iterdir())


def test_foreign_output_is_refused_before_any_work(app, bundle_folder, tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")

    result = run(app, "report", bundle_folder, "-o", tmp_path)

    assert isinstance(result.exception, OutputError)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_figures_are_told_on_stderr_and_json_stays_the_report(
    app, bundle_folder, tmp_path, monkeypatch
):
    monkeypatch.setattr("slamreplay.report.figure_files.PANELS", {"map": PANELS["map"]})
    figures = tmp_path / "r" / "figures"
    result = run(app, "report", bundle_folder, "-o", tmp_path / "r", "--figures", figures, "--json")

    assert result.exit_code == 0, result.output
    assert result.stdout == (tmp_path / "r" / "report.json").read_text(encoding="utf-8")
    told = [line.removeprefix("figure: ") for line in result.stderr.splitlines()]
    assert str(figures / "map.png") in told
    assert str(figures / "captions.md") in told
    assert (figures / "map.svg").exists()


@pytest.mark.parametrize("place", ["thesis", "r", "."])
def test_figures_in_a_foreign_place_are_refused_before_any_work(
    app, bundle_folder, tmp_path, place
):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "map.png").write_text("mine")

    result = run(app, "report", bundle_folder, "-o", tmp_path / "r", "--figures", tmp_path / place)

    assert isinstance(result.exception, OutputError if place == "thesis" else UsageError)
    assert "figures" in str(result.exception)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis"]


def test_bundle_takes_no_map(app, bundle_folder, tmp_path):
    result = run(app, "report", bundle_folder, "-o", tmp_path / "r", "--map", "m.yaml")

    assert isinstance(result.exception, UsageError)


@pytest.mark.parametrize("id_", list(FINDINGS))
def test_every_finding_is_explained(app, id_):
    words = " ".join(run(app, "explain", id_.lower()).stdout.split())
    fields = json.loads(run(app, "explain", id_, "--json").stdout)

    assert words.startswith(f"{id_} {FINDINGS[id_].title}")
    assert " ".join(FINDINGS[id_].misleads.split()) in words
    assert fields["id"] == id_
    assert fields["asks"] == FINDINGS[id_].asks


def test_unknown_finding_names_the_nearest(app):
    error = run(app, "explain", "SR-LOC-01").exception

    assert isinstance(error, UsageError)
    assert "SR-LOC-001" in str(error)


@pytest.mark.parametrize("kind", list_.KINDS)
def test_list_gives_names_and_docs(app, kind):
    rows = json.loads(run(app, "list", kind, "--json").stdout)
    text = run(app, "list", kind).stdout

    assert rows
    assert all(row["name"] and row["doc"] for row in rows)
    told = [line.split()[0] for line in text.splitlines() if line]
    if kind == "perturbations":  # they are grouped
        told = [name for name in told[1:] if "." in name]
    assert told == [row["name"] for row in rows]


def test_list_of_perturbations_has_the_unit_of_every_level(app):
    rows = {r["name"]: r for r in json.loads(run(app, "list", "perturbations", "--json").stdout)}

    assert rows["tf_delay.odometry"]["unit"] == "s"
    assert rows["scan_drop.random"]["baseline"] == 0.0
    assert rows["scan_drop.random"]["touches"] == ["scans"]
    assert (rows["scan_drop.random"]["low"], rows["scan_drop.random"]["high"]) == (0, 0.999)
    assert rows["initial_pose.global"]["is_switch"]
    for name in PERTURBATIONS:
        for variant in PERTURBATIONS.load(name).variants:
            assert f"{name}.{variant}" in rows


def test_list_of_perturbations_says_of_each_what_it_changes_and_what_levels_mean(app):
    text = run(app, "list", "perturbations").stdout

    groups = dict(part.split("\n", 1) for part in text.strip().split("\n\n")[1:])
    assert [head.partition(":")[0] for head in groups] == list(PERTURBATIONS)
    (head,) = (head for head in groups if head.startswith("odometry_scale:"))
    lines = groups[head].splitlines()
    assert lines[0] == "  changes odometry, transforms"
    assert lines[1].split()[:5] == ["odometry_scale.translation", "ratio,", "1", "(0", "to"]
    assert "settings min_score" in text
    assert "initial_pose.global                 0 or 1" in " ".join(text.split(" "))


def test_unknown_kind_is_refused(app):
    assert isinstance(run(app, "list", "robots").exception, UsageError)


def test_commands_import_nothing_heavy():
    code = (
        "import sys, slamreplay.cli.report, slamreplay.cli.explain, slamreplay.cli.list_;"
        "print(*sys.modules)"
    )
    heavy = {"numpy", "pandas", "matplotlib", "numba", "gtsam", "scipy", "jinja2", "pydantic"}

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert not heavy & set(done.stdout.split())


def test_what_cannot_be_held_out_is_named_before_the_log_is_read(app, tmp_path):
    log = tmp_path / "missing.mcap"
    result = run(app, "report", log, "-o", tmp_path / "r", "--hold-out", "survey")

    assert isinstance(result.exception, UsageError)
    assert "survey" in str(result.exception)
