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
from slamreplay.recipes.validation import validated


class BudgetFile(Strict):
    """The keys of the file."""

    version: Literal[1]
    question: Annotated[str, Field(min_length=1, max_length=300)]
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    scenario: str | None = None
    budget: Budget


@dataclass(frozen=True)
class BudgetRecipe:
    """A recipe that asks a log, or a simulated one, how old its poses were.

    Attributes:
        question: one sentence.
        seed: of replayed estimators.
        scenario: name of the log to simulate where none is given, None without any.
        parameters: budgets, stages and the gate's limit.
    """

    question: str
    seed: int
    scenario: str | None
    parameters: Budget


def budget_recipe(given: Mapping[str, Any], path: Path) -> BudgetRecipe:
    """The recipe in the keys of a YAML file.

    Raises:
        UsageError: a key that there is not, or a value that makes no sense.
    """
    from slamreplay.estimators import ESTIMATORS
    from slamreplay.simulate import SCENARIOS

    file = validated(BudgetFile, given, path)
    if " ".join(file.question.split()) != file.question:
        raise UsageError("'question' is not one line of text", where=path)
    if file.scenario is not None and file.scenario not in SCENARIOS:
        raise UsageError(f"there is no scenario {file.scenario[:80]!r}", where=path,
                         hint=f"there are: {', '.join(SCENARIOS)}")  # fmt: skip
    for asked in file.budget.replayed:
        try:
            ESTIMATORS.load(asked.estimator)
        except UsageError as error:
            raise UsageError(error.what, where=path, hint=error.hint) from error
    return BudgetRecipe(file.question, file.seed, file.scenario, file.budget)
