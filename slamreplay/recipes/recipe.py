"""A recipe's file: what kind it is, by the key that it has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from slamreplay.errors import UsageError
from slamreplay.gate.rules import Demands
from slamreplay.labs import LABS
from slamreplay.plain_yaml import read_plain_yaml
from slamreplay.recipes.budget import BudgetFile, BudgetRecipe, budget_recipe
from slamreplay.recipes.dose_recipe import DoseFile, DoseRecipe, dose_recipe
from slamreplay.recipes.gate_recipe import KEYS as GATE_KEYS
from slamreplay.recipes.gate_recipe import GateFile, GateRecipe, gate_recipe
from slamreplay.recipes.lab_recipe import LabFile, LabRecipe, lab_recipe
from slamreplay.recipes.validation import unknown_key

VERSION = 1

Recipe = LabRecipe | DoseRecipe | BudgetRecipe | GateRecipe
#: The key that only one kind has, and who reads it.
_KINDS: dict[str, Callable[[Mapping[str, Any], Path], Recipe]] = {
    "lab": lab_recipe,
    "perturbations": dose_recipe,
    "budget": budget_recipe,
}


def read_recipe(path: Path) -> Recipe:
    """The recipe in a YAML file: `lab`, `perturbations` (a design) or `budget` is its kind.

    One that has none of these, but what a gate demands, is a gate.

    Raises:
        UsageError: no plain YAML, another version, a name or a key that there is not, or a value
            that makes no sense: one line with the file, the key and a hint.
    """
    given = read_plain_yaml(path, kind="recipe", hint="begin with version: 1")
    version = given.get("version", VERSION)
    if type(version) is not int or version != VERSION:
        said = repr(version)[:40]
        raise UsageError(f"version {said}, this program reads {VERSION}", where=path)
    kinds = [key for key in _KINDS if key in given]
    if len(kinds) > 1:
        raise UsageError(f"it has both '{kinds[0]}' and '{kinds[1]}'", where=path,
                         hint="a recipe asks one question")  # fmt: skip
    if kinds:
        return _KINDS[kinds[0]](given, path)
    known = {**LabFile.model_fields, **DoseFile.model_fields, **BudgetFile.model_fields,
             **GateFile.model_fields}  # fmt: skip
    for key in given:
        if key not in known:
            what, hint = unknown_key(key, known)
            raise UsageError(what, where=path, hint=hint)
    if any(key in given for key in GATE_KEYS):
        return gate_recipe(given, path)
    raise UsageError(
        "the key 'lab', 'perturbations' or 'budget' is missing", where=path,
        hint=f"lab: one of {', '.join(LABS)}; perturbations: a list of name and levels; budget: "
        "rates and stages; expect, forbid or limits: of a gate",
    )  # fmt: skip


def read_demands(path: Path) -> Demands:
    """What a gate's recipe demands.

    Raises:
        UsageError: as of `read_recipe`, or it is of another kind, with the command that takes it.
    """
    recipe = read_recipe(path)
    if isinstance(recipe, GateRecipe):
        return recipe.demands
    raise UsageError(
        "it is no gate: it has none of expect, forbid, max_severity, logs",
        where=path,
        hint=f"slamreplay perturb --recipe {path}",
    )
