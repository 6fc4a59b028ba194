"""What the docs say of notebooks is true: their examples are run."""

import ast
import doctest
import re
from importlib import import_module
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).parent.parent
README = ROOT / "slamreplay" / "notebook" / "README.md"
TOLD = re.compile(r"# -> (.*)$")


@pytest.fixture(scope="module", autouse=True)
def _in_a_folder_with_the_samples(tmp_path_factory):
    folder = tmp_path_factory.mktemp("notebook")
    (folder / "sample_logs").symlink_to(ROOT / "sample_logs")
    (folder / "out").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        patch.setattr(mpl, "rcParams", mpl.rcParams.copy())
        yield
    plt.close("all")


def run(block: str, names: dict[str, object]) -> list[tuple[str, str]]:
    """What stands behind each `# ->` of a block, and what came out."""
    lines, found = block.split("\n"), []
    for statement in ast.parse(block).body:
        if not isinstance(statement, ast.Expr):
            exec(compile(ast.Module([statement], []), str(README), "exec"), names)
            continue
        value = eval(compile(ast.Expression(statement.value), str(README), "eval"), names)
        if told := TOLD.search(lines[statement.end_lineno - 1]):
            found.append((told.group(1).strip(), str(value)))
    return found


def test_the_blocks_of_the_readme_run_and_give_what_they_say():
    blocks = re.findall(r"^```python\n(.*?)^```$", README.read_text("utf-8"), re.M | re.S)
    names: dict[str, object] = {}
    found = [pair for block in blocks for pair in run(block, names)]

    assert len(found) >= 8
    assert [told for told, _ in found] == [came for _, came in found]
    assert Path("out/aisle.png").stat().st_size > 10_000


@pytest.mark.parametrize("module", ["catalogue", "reading", "reporting", "running"])
def test_the_examples_of_docstrings_run(module):
    done = doctest.testmod(
        import_module(f"slamreplay.notebook.{module}"), optionflags=doctest.NORMALIZE_WHITESPACE
    )

    assert done.attempted
    assert not done.failed
    plt.close("all")
