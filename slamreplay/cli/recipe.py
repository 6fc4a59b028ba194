"""What `slamreplay perturb` does with a recipe: each kind takes what it can of the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.ingest.options import IngestOptions


@dataclass(frozen=True)
class Given:
    """The command line beside the recipe.

    Attributes:
        logs: the log.
        how: to ingest it.
        perturbations: as texts.
        estimators: by name.
        parameters: files of them.
        robot: namespace whose parameters count.
        seed: None where none was given.
        of_logs: names of the options that only a log takes.
    """

    logs: Sequence[Path]
    how: IngestOptions
    perturbations: Sequence[str]
    estimators: Sequence[str]
    parameters: Sequence[Path]
    robot: str | None
    seed: int | None
    of_logs: Sequence[str]


def run_recipe(path: Path, output: Path, given: Given, *, as_json: bool) -> None:
    """Answer a recipe's question.

    Raises:
        UsageError: a recipe that cannot be read, or something of the command line that its kind
            has no use for.
    """
    from slamreplay.cli.budget import run_budget
    from slamreplay.cli.dose import run_design
    from slamreplay.cli.lab import run_lab
    from slamreplay.recipes import BudgetRecipe, GateRecipe, LabRecipe, read_recipe

    recipe = read_recipe(path)
    of_runs = {
        "--perturbation": given.perturbations,
        "--estimator": given.estimators,
        "--parameters": given.parameters,
    }
    names = [name for name, value in of_runs.items() if value]
    if isinstance(recipe, GateRecipe):
        raise UsageError("it is a gate, which perturbs nothing", where=path,
                         hint=f"slamreplay gate LOG... --recipe {path}")  # fmt: skip
    if isinstance(recipe, LabRecipe):
        foreign = [*(["LOG"] if given.logs else []), *names, *given.of_logs]
        run_lab(recipe, path, output, seed=given.seed, given=foreign, as_json=as_json)
    elif isinstance(recipe, BudgetRecipe):
        run_budget(recipe, path, given.logs, given.how, output, seed=given.seed, given=names,
                   as_json=as_json)  # fmt: skip
    elif given.perturbations:
        raise UsageError("the recipe says what is perturbed: it takes no --perturbation",
                         where=path, hint="leave it out")  # fmt: skip
    else:
        run_design(
            recipe,
            path,
            output,
            logs=given.logs,
            how=given.how,
            estimators=given.estimators,
            parameters=given.parameters,
            robot=given.robot,
            seed=given.seed,
            as_json=as_json,
        )
