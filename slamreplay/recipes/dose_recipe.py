"""The recipe of a design on a log: perturbations with levels or a search, and what is broken."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field

from slamreplay.doses.metrics import limit_of
from slamreplay.doses.plan import MAX_TRIALS, Axis, Dose, Plan, of_levels, of_search, variant_of
from slamreplay.errors import UsageError
from slamreplay.estimators import ESTIMATORS
from slamreplay.labs.lab import Strict
from slamreplay.recipes.scenario import ScenarioPart, scenario_of
from slamreplay.recipes.validation import one_line, validated

_Seed = Annotated[int, Field(ge=0, lt=2**63 - 1000)]
_Positive = Annotated[float, Field(gt=0)]
_Levels = Annotated[list[float], Field(min_length=1, max_length=100)]
_Name = Annotated[str, Field(min_length=1, max_length=80)]
_UNITS = ("s", "m", "deg", "ratio")

T = TypeVar("T")


class SearchPart(Strict):
    """The range of a search, and the width of the bracket that it ends with."""

    first: Annotated[float, Field(alias="from")]
    to: float
    tolerance: _Positive


class PerturbationPart(Strict):
    """A perturbation and its levels, the unit in the key's name: one key of the eight."""

    name: _Name
    levels_s: _Levels | None = None
    levels_m: _Levels | None = None
    levels_deg: _Levels | None = None
    levels_ratio: _Levels | None = None
    search_s: SearchPart | None = None
    search_m: SearchPart | None = None
    search_deg: SearchPart | None = None
    search_ratio: SearchPart | None = None


class ControlPart(Strict):
    """One level that is known to break every estimator, the unit in the key's name."""

    name: _Name
    level_s: float | None = None
    level_m: float | None = None
    level_deg: float | None = None
    level_ratio: float | None = None


class DoseFile(Strict):
    """The keys of such a file."""

    version: Literal[1]
    question: Annotated[str, Field(min_length=1, max_length=300)]
    seed: _Seed
    seeds: Annotated[int, Field(ge=1, le=200)]
    scenario: ScenarioPart | None = None
    estimators: Annotated[list[_Name], Field(min_length=1, max_length=50)]
    limits: Annotated[
        dict[str, Annotated[float, Field(ge=0)]],
        Field(min_length=1, max_length=20),
    ]
    perturbations: Annotated[list[PerturbationPart], Field(min_length=1, max_length=50)]
    positive_control: ControlPart | None = None


@dataclass(frozen=True)
class DoseRecipe:
    """A design, and the simulated log it is on where the command line names none.

    Attributes:
        plan: what is asked.
        scenario: name and seed of a simulated log; None where a log is needed.
    """

    plan: Plan
    scenario: tuple[str, int] | None

    @property
    def question(self) -> str:
        """One sentence."""
        return self.plan.question


def dose_recipe(given: Mapping[str, Any], path: Path) -> DoseRecipe:
    """The recipe in what its file says.

    Raises:
        UsageError: a key, name or metric that there is not, a unit that is not the variant's, or a
            value that makes no sense.
    """
    file = validated(DoseFile, given, path)
    one_line("question", file.question, path)
    axes = [
        _at(f"perturbations.{k}", path, _axis, part) for k, part in enumerate(file.perturbations)
    ]
    twice = [key for key, n in Counter((a.perturbation, a.side) for a in axes).items() if n > 1]
    if twice:
        raise UsageError(
            f"'perturbations' names {twice[0][0]} twice", where=path, hint="put its levels together"
        )
    _at("estimators", path, check_estimators, file.estimators)
    plan = Plan(
        file.question,
        tuple(range(file.seed, file.seed + file.seeds)),
        tuple(file.estimators),
        tuple(_at("limits", path, limit_of, *limit) for limit in file.limits.items()),
        tuple(axes),
        None
        if file.positive_control is None
        else _at("positive_control", path, _control, file.positive_control),
    )
    if plan.most_trials > MAX_TRIALS:
        raise UsageError(
            f"it asks for up to {plan.most_trials} trials, more than {MAX_TRIALS}", where=path
        )
    return DoseRecipe(plan, scenario_of(file.scenario, path))


def check_estimators(names: list[str]) -> None:
    """Refuse names that no trial can be made of.

    Raises:
        UsageError: an unknown name, or one given twice.
    """
    for name in names:
        ESTIMATORS.target(name)
    if len(set(names)) != len(names):
        raise UsageError("an estimator is named twice")


def _at(key: str, path: Path, make: Callable[..., T], *values: Any) -> T:
    """What `make` makes of the values under a key; its fault names file and key."""
    try:
        return make(*values)
    except UsageError as error:
        raise UsageError(error.what, where=f"{path}: '{key}'", hint=error.hint) from error


def _axis(part: PerturbationPart) -> Axis:
    kind, value = _only(part, ("levels", "search"))
    if kind == "levels":
        return of_levels(part.name, value)
    return of_search(part.name, value.first, value.to, value.tolerance)


def _control(part: ControlPart) -> Dose:
    _, level = _only(part, ("level",))
    name, unit, baseline = variant_of(part.name, (level,))
    if level == baseline:
        raise UsageError(f"level {level:g} of {name} is its baseline, which breaks nothing")
    return Dose(name, unit, level)


def _only(part: PerturbationPart | ControlPart, kinds: tuple[str, ...]) -> tuple[str, Any]:
    """The one key that holds levels, if it is in the variant's unit, and its value."""
    name, unit, _ = variant_of(part.name, ())
    keys = [f"{kind}_{u}" for kind in kinds for u in _UNITS]
    given = [key for key in keys if getattr(part, key) is not None]
    right = " or ".join(f"{kind}_{unit}" for kind in kinds)
    if len(given) != 1:
        found = f"both {given[0]} and {given[1]}" if given else "no level"
        raise UsageError(
            f"{name} has {found}", hint=f"write one of {right}" if given else f"write {right}"
        )
    kind, _, written = given[0].partition("_")
    if written != unit:
        raise UsageError(
            f"{given[0]}: the level of {name} is in {unit}", hint=f"write {kind}_{unit}"
        )
    return kind, getattr(part, given[0])
