"""A recipe's file: what kind it is, by the key that it has, and what it asks for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from slamreplay.errors import UsageError
from slamreplay.labs import LABS
from slamreplay.labs.lab import Lab
from slamreplay.plain_yaml import read_plain_yaml
from slamreplay.recipes.validation import unknown_key, validated

VERSION = 1


class _LabFile(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

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


def read_recipe(path: Path) -> LabRecipe:
    """The recipe in a YAML file; `lab` says that it is a laboratory.

    Raises:
        UsageError: no plain YAML, another version, a lab or a key that there is not, or a value
            that makes no sense: one line with the file, the key and a hint.
    """
    given = read_plain_yaml(path, kind="recipe", hint="begin with version: 1")
    version = given.get("version", VERSION)
    if type(version) is not int or version != VERSION:
        said = repr(version)[:40]
        raise UsageError(f"version {said}, this program reads {VERSION}", where=path)
    if "lab" not in given:
        known = _LabFile.model_fields
        for key in given:
            if key not in known:
                what, hint = unknown_key(key, known)
                raise UsageError(what, where=path, hint=hint)
        raise UsageError("the key 'lab' is missing", where=path, hint=f"one of {', '.join(LABS)}")
    file = validated(_LabFile, given, path)
    if " ".join(file.question.split()) != file.question:
        raise UsageError("'question' is not one line of text", where=path)
    try:
        model = LABS.load(file.lab)
    except UsageError as error:
        raise UsageError(error.what, where=path, hint=error.hint) from error
    parameters = validated(model, file.parameters, path, under="parameters")
    return LabRecipe(file.question, file.lab, file.seed, parameters)
