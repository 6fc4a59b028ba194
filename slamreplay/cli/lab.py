"""What `slamreplay perturb` does with a recipe that is a laboratory: run, write, print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slamreplay.cli.options import checked_seed
from slamreplay.cli.terminal import complain, say, say_json, say_table
from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.labs.lab import LabResults, ResultTable
    from slamreplay.recipes import LabRecipe


def run_lab(
    recipe: LabRecipe,
    path: Path,
    output: Path,
    *,
    seed: int | None,
    given: Sequence[str],
    as_json: bool,
) -> None:
    """Answer a recipe's question.

    Args:
        recipe: the question.
        path: its file, for faults.
        output: folder to write.
        seed: in place of the recipe's own.
        given: names of arguments and options of the command line that only a log can take.
        as_json: print the results as JSON.

    Raises:
        UsageError: a log given to a lab, or a seed that is none.
    """
    from slamreplay.cli.progress import progress_bar
    from slamreplay.labs.folder import check_results_target, write_results

    if given:
        raise UsageError(
            f"the lab {recipe.lab} simulates what it needs: it takes no {', '.join(given)}",
            where=path,
            hint="leave it out",
        )
    seed = recipe.seed if seed is None else checked_seed(seed)
    check_results_target(output)
    with progress_bar("simulating") as progress:
        results = recipe.parameters.run(seed, progress)
    head = {
        "question": recipe.question,
        "lab": recipe.lab,
        "seed": seed,
        "parameters": recipe.parameters.model_dump(mode="json"),
    }
    write_results(output, head, results)
    show(head, results, output, as_json=as_json)


def show(head: dict[str, Any], results: LabResults, output: Path, *, as_json: bool) -> None:
    """Print what was written to a folder: the tables, or the results as JSON."""
    from slamreplay.labs.folder import results_json

    if as_json:
        say_json(results_json(head, results))
        return
    say((str(head["question"]), "head"))
    for table in results.tables:
        say()
        say(table.title)
        say_table(_rows(table), indent=2)
    complain(f"results written to {output}")


def _rows(table: ResultTable) -> list[list[str]]:
    columns = [k for k, name in enumerate(table.head) if name in (table.brief or table.head)]
    return [[row[k] for k in columns] for row in (table.head, *table.rows)]
