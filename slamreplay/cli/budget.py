"""What `slamreplay perturb` does with a recipe that is a budget: read, answer, write, print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.cli.options import checked_seed
from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.recipes.budget import BudgetRecipe


def run_budget(
    recipe: BudgetRecipe,
    path: Path,
    logs: Sequence[Path],
    options: IngestOptions,
    output: Path,
    *,
    seed: int | None,
    given: Sequence[str],
    as_json: bool,
) -> None:
    """Answer a budget recipe's question about a log, or about the scenario it names.

    Args:
        recipe: what was asked.
        path: its file, for errors.
        logs: the log; the scenario takes its place where there is none.
        options: how to read the log.
        output: folder to write.
        seed: in place of the recipe's own.
        given: names of options of the command line that this kind of recipe cannot take.
        as_json: print the results as JSON.

    Raises:
        UsageError: neither log nor scenario, or an option that has no meaning here.
    """
    from slamreplay.caches import run_folder
    from slamreplay.cli.lab import show
    from slamreplay.cli.progress import progress_bar
    from slamreplay.cli.scenario import log_or_scenario
    from slamreplay.labs.folder import check_results_target, write_results
    from slamreplay.labs.latency_budget.answer import answer
    from slamreplay.labs.latency_budget.pages import results

    if given:
        raise UsageError(f"a budget takes no {', '.join(given)}", where=path, hint="leave it out")
    seed = recipe.seed if seed is None else checked_seed(seed)
    check_results_target(output)
    with log_or_scenario(logs, recipe.scenario, options, path) as bundle:
        with progress_bar("replaying") as progress:
            found = results(answer(bundle, recipe.parameters, seed, progress, run_folder()))
        head = {
            "question": recipe.question,
            "log": [source.name for source in bundle.manifest.sources],
            "bundle": bundle.manifest.bundle_id,
            "scenario": None
            if logs or recipe.scenario is None
            else dict(zip(("name", "seed"), recipe.scenario, strict=True)),
            "seed": seed,
            "budget": recipe.parameters.model_dump(mode="json"),
        }
    write_results(output, head, found)
    show(head, found, output, as_json=as_json)
