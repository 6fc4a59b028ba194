"""The recipe of a laboratory: a question that a simulation of its own answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from slamreplay.errors import UsageError
from slamreplay.labs import LABS
from slamreplay.labs.lab import Lab, Strict
from slamreplay.recipes.validation import one_line, validated


class LabFile(Strict):
    """The keys of such a file."""

    version: Literal[1]
    question: Annotated[str, Field(min_length=1, max_length=300)]
    lab: str
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    parameters: dict[str, Any]


@dataclass(frozen=True)
class LabRecipe:
    """A recipe that needs no log.

    Attributes:
        question: one sentence.
        lab: name in the registry.
        seed: of every random number.
        parameters: the lab with what the recipe sets; `run` answers.
    """

    question: str
    lab: str
    seed: int
    parameters: Lab


def lab_recipe(given: Mapping[str, Any], path: Path) -> LabRecipe:
    """The recipe in what its file says.

    Raises:
        UsageError: a lab or a key that there is not, or a value that makes no sense.
    """
    file = validated(LabFile, given, path)
    one_line("question", file.question, path)
    try:
        model = LABS.load(file.lab)
    except UsageError as error:
        raise UsageError(error.what, where=path, hint=error.hint) from error
    parameters = validated(model, file.parameters, path, under="parameters")
    return LabRecipe(file.question, file.lab, file.seed, parameters)
