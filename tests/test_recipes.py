"""Every recipe is documentation and a golden test; and a recipe that is none gets one line."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from slamreplay.errors import UsageError
from slamreplay.labs import LABS
from slamreplay.recipes import DoseRecipe, read_recipe

ROOT = Path(__file__).resolve().parents[1]
#: A folder without a recipe holds what people copy: scripts and manifests.
RECIPES = sorted(path.parent for path in (ROOT / "recipes").glob("*/recipe.yaml"))
BREATHING = ROOT / "recipes" / "covariance-breathing" / "recipe.yaml"
PROGRAM = str(Path(sys.executable).with_name("slamreplay"))


def run(*arguments, **env):
    return subprocess.run(
        [PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=600,
        env=os.environ | env,
    )


def says_one_line(done):
    """The fault in one line on stderr, exit code 2, nothing on stdout."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr


def replayed(recipe):
    """The file that the tests replay: a recipe of minutes has a smaller one beside it."""
    golden = recipe / "golden.yaml"
    return golden if golden.exists() else recipe / "recipe.yaml"


@pytest.fixture(scope="module")
def answered(tmp_path_factory):
    """Each recipe's folder to what the program wrote for it."""
    out = tmp_path_factory.mktemp("answers")
    for recipe in RECIPES:
        done = run("perturb", "--recipe", replayed(recipe), "-o", out / recipe.name)
        assert done.returncode == 0, done.stderr
        assert read_recipe(recipe / "recipe.yaml").question in done.stdout
        assert str(out / recipe.name) in done.stderr
    return out


def test_there_are_recipes():
    assert BREATHING.parent in RECIPES


def differences(expected, found, tolerance, where="results"):
    """Places where what was found is not what was expected; what is not expected may be anything.

    A recipe whose every number hangs on all estimators expects those that its page is about.
    """
    if isinstance(expected, dict):
        if not isinstance(found, dict) or not expected.keys() <= found.keys():
            return [f"{where}: other keys"]
        return [d for k in expected
                for d in differences(expected[k], found[k], tolerance, f"{where}.{k}")]  # fmt: skip
    if isinstance(expected, list):
        if not isinstance(found, list) or len(expected) != len(found):
            return [f"{where}: another length"]
        return [d for k, pair in enumerate(zip(expected, found, strict=True))
                for d in differences(*pair, tolerance, f"{where}[{k}]")]  # fmt: skip
    if isinstance(expected, float) and isinstance(found, float | int):
        close = math.isclose(expected, found, rel_tol=tolerance, abs_tol=1e-12)
    else:
        close = expected == found and type(expected) is type(found)
    return [] if close else [f"{where}: {found} instead of {expected}"]


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda path: path.name)
def test_numbers_are_the_expected_ones(recipe, answered):
    golden = json.loads((recipe / "expected.json").read_text(encoding="utf-8"))
    found = json.loads((answered / recipe.name / "results.json").read_text(encoding="utf-8"))

    assert differences(golden["results"], found["results"], golden["relative_tolerance"]) == []


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda path: path.name)
def test_readme_names_question_command_and_pictures(recipe, answered):
    page = (recipe / "README.md").read_text(encoding="utf-8")
    shown = [line.split("](")[1].rstrip(")") for line in page.splitlines() if line[:2] == "!["]

    assert read_recipe(recipe / "recipe.yaml").question in page
    command = f"--recipe recipes/{recipe.name}/recipe.yaml -o "
    assert any(f"slamreplay perturb {log}{command}" in page for log in ("", "LOG "))
    assert shown
    for name in shown:
        ours, now = (
            np.asarray(Image.open(folder / name).convert("L"), dtype=float)
            for folder in (recipe, answered / recipe.name)
        )
        if replayed(recipe).name == "golden.yaml":  # the README's is of all logs
            assert ours.shape[1] == now.shape[1]
            continue
        assert ours.shape == now.shape
        assert np.abs(ours - now).mean() < 1.0  # of 255: the README shows today's picture


def is_smaller(golden, full):
    """Whether a golden recipe asks the same with fewer logs, and of lists a part."""
    if isinstance(full, dict):
        return golden.keys() == full.keys() and all(is_smaller(golden[k], full[k]) for k in full)
    if isinstance(full, list):
        return len(golden) > 0 and all(value in full for value in golden)
    return golden == full or (type(full) is int and 0 < golden < full)


def is_part(golden, full):
    """Whether a golden design asks the same with fewer seeds, estimators, perturbations, levels."""
    axes = {(axis.perturbation, axis.side): axis for axis in full.axes}
    return (
        (golden.question, golden.limits) == (full.question, full.limits)
        and golden.positive_control == full.positive_control
        and golden.seeds == full.seeds[: len(golden.seeds)]
        and set(golden.estimators) <= set(full.estimators)
        and all(
            (axis.perturbation, axis.side) in axes
            and abs(axis.levels[-1] - axis.baseline)
            <= abs(axes[axis.perturbation, axis.side].levels[-1] - axis.baseline)
            for axis in golden.axes
        )
    )


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda path: path.name)
def test_a_golden_recipe_asks_the_same(recipe):
    full, golden = (read_recipe(path) for path in (recipe / "recipe.yaml", replayed(recipe)))

    assert type(full) is type(golden)
    if isinstance(full, DoseRecipe):
        assert golden.scenario is not None  # a test has no log of its own
        assert full.scenario in (None, golden.scenario)
        assert is_part(golden.plan, full.plan)
        return
    for name in ("question", "lab", "scenario", "seed"):
        assert getattr(full, name, None) == getattr(golden, name, None)
    assert is_smaller(golden.parameters.model_dump(), full.parameters.model_dump())


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda path: path.name)
def test_page_and_figures_are_there(recipe, answered):
    names = {path.name for path in (answered / recipe.name).iterdir()}
    figures = {name for name in names if name.endswith(".png")}

    assert {"results.json", "results.md"} <= names
    assert figures
    assert {name.replace(".png", ".svg") for name in figures} <= names
    page = (answered / recipe.name / "results.md").read_text(encoding="utf-8")
    assert all(f"({name})" in page for name in figures)


def test_margins_are_checked_by_their_script(answered, tmp_path):
    folder = ROOT / "recipes" / "ci-gate"
    results = answered / folder.name / "results.json"
    curves = json.loads(results.read_text(encoding="utf-8"))["results"]["curves"]
    demanded = json.loads((folder / "margins.json").read_text(encoding="utf-8"))
    held = {p: {e: demanded[p][e] for e in by_estimator} for p, by_estimator in curves.items()}
    margins = tmp_path / "margins.json"

    def checked():
        command = [sys.executable, folder / "check.py", results, margins]
        return subprocess.run(command, capture_output=True, text=True)

    margins.write_text(json.dumps(held), encoding="utf-8")
    assert (checked().returncode, checked().stdout) == (0, "every margin holds\n")
    margins.write_text(json.dumps({"initial_pose.offset": {"amcl": 4.0}}), encoding="utf-8")
    assert checked().returncode == 1
    margins.write_text(json.dumps({"scan_delay.stamp": {"amcl": 0.1}}), encoding="utf-8")
    assert "not tried" in checked().stdout


SMALL = BREATHING.read_text(encoding="utf-8").replace("runs: 1000", "runs: 30")


@pytest.fixture
def small(tmp_path):
    (tmp_path / "recipe.yaml").write_text(SMALL, encoding="utf-8")
    return tmp_path / "recipe.yaml"


def test_same_recipe_and_seed_same_bytes(small, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    one, two = (
        run("perturb", "--recipe", small, "-o", out, "--seed", 7, "--json", PYTHONHASHSEED=salt)
        for out, salt in ((first, "1"), (second, "2"))
    )

    assert json.loads(one.stdout)["seed"] == 7  # the command line goes before the recipe
    assert one.stdout == two.stdout == (first / "results.json").read_text(encoding="utf-8")
    names = sorted(path.name for path in first.iterdir())
    assert names == sorted(path.name for path in second.iterdir())
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


def test_a_lab_takes_no_log_and_no_options_of_one(small, tmp_path):
    text = says_one_line(run("perturb", "my.bag", "--recipe", small, "-o", tmp_path / "o",
                             "-p", "tf_delay=1", "--map", "m.yaml"))  # fmt: skip

    assert "takes no LOG, --perturbation, --map" in text
    assert not (tmp_path / "o").exists()


def test_neither_log_nor_lab(tmp_path):
    assert "there is no LOG" in says_one_line(run("perturb", "-o", tmp_path / "o"))


def test_a_folder_with_somebody_elses_results_is_refused(small, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "results.json").write_text('{"accuracy": 0.9}', encoding="utf-8")

    assert "of something else" in says_one_line(run("perturb", "--recipe", small, "-o", mine))
    assert (mine / "results.json").read_text(encoding="utf-8") == '{"accuracy": 0.9}'
    text = says_one_line(run("perturb", "--recipe", small, "-o", BREATHING.parent))
    assert "holds no results.json" in text


def test_labs_are_listed():
    lines = run("list", "labs").stdout.splitlines()

    assert [line.split()[0] for line in lines] == list(LABS)
    assert all(len(line.split()) > 3 for line in lines)


BOMB = "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nversion: *c\n"

HOSTILE = {
    "empty": ("", "lines of KEY: VALUE"),
    "a list": ("- 1\n", "lines of KEY: VALUE"),
    "python tag": ("version: !!python/object/apply:os.system ['true']\n", "tags"),
    "any tag": (SMALL.replace("seed: 1", "seed: !!int 1"), "line 6: tags"),
    "aliases": (BOMB, "line 2: aliases"),
    "key twice": (SMALL + "seed: 2\n", "the key 'seed' is given twice"),
    "inner key twice": (SMALL.replace("runs: 30", "runs: 30\n  runs: 31"), "'runs' is given twice"),
    "merge": ("<<: {a: 1}\nlab: x\n", "no key '<<'"),
    "key that is a list": ("[a]: 1\n", "a key must be a text"),
    "deep": ("a: " + "[" * 5000 + "]" * 5000, "nested more than"),
    "broken": ("version: [1\n", "line 2"),
    "two documents": (SMALL + "---\na: 1\n", "second document"),
    "control characters": ("version: \x00\n", "not YAML"),
    "long": ("# " + "x" * 200_000, "larger than"),
    "version": (SMALL.replace("version: 1", "version: 2"), "version 2, this program reads 1"),
    "version as text": (SMALL.replace("version: 1", "version: '1'"), "version '1'"),
    "no question": (SMALL.replace("question:", "qestion:"), "did you mean 'question'?"),
    "lab misspelt": (SMALL.replace("covariance_breathing", "covariance_breathin"), "did you mean"),
    "lab elsewhere": (SMALL.replace("lab: covariance_breathing", "lab: os:system"), "no lab"),
    "key of lab misspelt": (SMALL.replace("lab:", "labb:"), "did you mean 'lab'?"),
    "no lab": ("version: 1\n", "the key 'lab', 'perturbations' or 'budget' is missing"),
    "key": (SMALL.replace("step_m:", "stp_m:", 1), "'parameters.stp_m' (hint"),
    "parameter": (SMALL.replace("range_sigma_m:", "range_sigma:"), "mean 'range_sigma_m'?"),
    "nested": (SMALL.replace("grows_from_ratio", "grows_ratio"), "mean 'grows_from_ratio'?"),
    "in a list": (SMALL.replace("every_steps: 8", "every_step: 8"), "mean 'every_steps'?"),
    "missing": (SMALL.replace("  closure_sigma_m:", "  # "), "'parameters.closure_sigma_m' is mis"),
    "nan": (SMALL.replace("range_sigma_m: 0.1", "range_sigma_m: .nan"), "is nan: it should be"),
    "infinite": (SMALL.replace("range_sigma_m: 0.1", "range_sigma_m: .inf"), "finite"),
    "overflow": (SMALL.replace("range_sigma_m: 0.1", "range_sigma_m: 1e999"), "finite"),
    "negative": (SMALL.replace("[0.01,", "[-0.01,"), "process_noise_m2_per_step.0' is -0.01"),
    "text": (SMALL.replace("runs: 30", "runs: many"), "'parameters.runs' is 'many'"),
    "number in quotes": (SMALL.replace("runs: 30", "runs: '30'"), "'parameters.runs' is '30'"),
    "truth": (SMALL.replace("runs: 30", "runs: true"), "'parameters.runs' is True"),
    "huge": (SMALL.replace("runs: 30", "runs: 1000000000000"), "less than or equal to"),
    "huge digits": (SMALL.replace("runs: 30", "runs: " + "9" * 5000), "'parameters.runs' is"),
    "huge in all": (SMALL.replace("runs: 30", "runs: 99999"), "steps times runs"),
    "seed": (SMALL.replace("seed: 1", "seed: -1"), "'seed' is -1"),
    "list for a number": (SMALL.replace("runs: 30", "runs: [30]"), "'parameters.runs': should"),
    "number for a list": (SMALL.replace("collapse:\n", "collapse: 3\n#"), "line"),
    "parameters": (SMALL.split("parameters:")[0] + "parameters: 3\n", "'parameters' is 3"),
    "escape": (SMALL.replace("seed: 1", '"\\e[31m": 1'), "no key '\\x1b[31m'"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_recipe_that_is_none_gets_one_clear_line(name, tmp_path):
    text, said = HOSTILE[name]
    path = tmp_path / "recipe.yaml"
    path.write_text(text, encoding="utf-8")

    with pytest.raises(UsageError) as caught:
        read_recipe(path)

    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert said in line
    assert "\n" not in line
    assert len(line) < len(str(path)) + 400
    assert all(letter.isprintable() for letter in line)


def test_what_is_no_file_is_said(tmp_path):
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00version: 1")
    os.mkfifo(tmp_path / "pipe.yaml")

    for path, said in (
        (tmp_path, "not a file"),
        (tmp_path / "gone.yaml", "cannot read the recipe: No such file"),
        (tmp_path / "bytes.yaml", "UTF-8"),
        (tmp_path / "pipe.yaml", "not a file"),
        (Path("a\0b"), "cannot read"),
    ):
        with pytest.raises(UsageError, match=said):
            read_recipe(path)


@pytest.mark.parametrize("name", ["python tag", "aliases", "negative", "key"])
def test_the_program_says_it_with_exit_code_2(name, tmp_path):
    (tmp_path / "r.yaml").write_text(HOSTILE[name][0], encoding="utf-8")

    text = says_one_line(run("perturb", "--recipe", tmp_path / "r.yaml", "-o", tmp_path / "o"))

    assert HOSTILE[name][1] in text
    assert not (tmp_path / "o").exists()


def test_numbers_are_read_as_people_write_them(tmp_path):
    text = SMALL.replace("range_sigma_m: 0.1", "range_sigma_m: 1e-1").replace(
        "seed: 1", "seed: 010"
    )
    (tmp_path / "r.yaml").write_text(text, encoding="utf-8")

    recipe = read_recipe(tmp_path / "r.yaml")

    assert recipe.parameters.range_sigma_m == 0.1
    assert recipe.seed == 10  # not eight: YAML 1.2


@settings(max_examples=150, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, len(SMALL)),
            st.integers(0, 12),
            st.sampled_from(
                ["", " ", "\n", "-", "0", "9" * 400, "1e400", "&a ", "*a", "!!set ", "{", "[",
                 "]", "}", ": ", "'", '"', "%", "\t", "\\", "null", "~", ".nan", "\u2028", "\x07"]
            ),
        ),
        min_size=1,
        max_size=4,
    )
)  # fmt: skip
def test_a_damaged_recipe_is_read_or_refused_in_one_line(edits):
    text = SMALL
    for at, length, put in edits:
        text = text[:at] + put + text[at + length :]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "recipe.yaml"
        path.write_text(text, encoding="utf-8")
        said = ""
        try:
            read_recipe(path)
        except UsageError as error:
            said = str(error)
        assert said.isprintable()
        assert len(said) < 500
