"""A simulated log that a recipe is asked of where the command line names none."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from slamreplay.errors import UsageError
from slamreplay.labs.lab import Strict
from slamreplay.registry import nearest
from slamreplay.simulate import SCENARIOS


class ScenarioPart(Strict):
    """The key `scenario` of a recipe's file."""

    name: Annotated[str, Field(min_length=1, max_length=80)]
    seed: Annotated[int, Field(ge=0, lt=2**63)]


def scenario_of(part: ScenarioPart | None, path: Path) -> tuple[str, int] | None:
    """Name and seed; None where the file has no such key.

    Raises:
        UsageError: there is no such scenario.
    """
    if part is None:
        return None
    if part.name not in SCENARIOS:
        raise UsageError(
            f"there is no scenario {part.name!r}",
            where=f"{path}: 'scenario.name'",
            hint=nearest(part.name, SCENARIOS),
        )
    return part.name, part.seed
