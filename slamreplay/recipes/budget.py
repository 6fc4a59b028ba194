"""The kind of recipe that has the key `budget`: whether poses of a log come fresh enough."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from slamreplay.errors import UsageError
from slamreplay.labs.lab import Strict
from slamreplay.labs.latency_budget.ask import Budget
from slamreplay.recipes.scenario import ScenarioPart, scenario_of
from slamreplay.recipes.validation import one_line, validated


class BudgetFile(Strict):
    """The keys of the file."""

    version: Literal[1]
    question: Annotated[str, Field(min_length=1, max_length=300)]
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    scenario: ScenarioPart | None = None
    budget: Budget


@dataclass(frozen=True)
class BudgetRecipe:
    """A recipe that asks a log, or a simulated one, how old its poses were.

    Attributes:
        question: one sentence.
        seed: of replayed estimators.
        scenario: name and seed of a simulated log; None where a log is needed.
        parameters: budgets, stages and the gate's limit.
    """

    question: str
    seed: int
    scenario: tuple[str, int] | None
    parameters: Budget


def budget_recipe(given: Mapping[str, Any], path: Path) -> BudgetRecipe:
    """The recipe in the keys of a YAML file.

    Raises:
        UsageError: a key that there is not, or a value that makes no sense.
    """
    from slamreplay.estimators import ESTIMATORS

    file = validated(BudgetFile, given, path)
    one_line("question", file.question, path)
    for asked in file.budget.replayed:
        try:
            ESTIMATORS.load(asked.estimator)
        except UsageError as error:
            raise UsageError(error.what, where=path, hint=error.hint) from error
    scenario = scenario_of(file.scenario, path)
    return BudgetRecipe(file.question, file.seed, scenario, file.budget)
