"""Figures that a run of the benchmark must reach, as CI asks for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from slamreplay.errors import UsageError

Sense = Literal[">=", "<="]


@dataclass(frozen=True)
class Goal:
    """A bound on one figure; `path` leads to it in the scores of results.json."""

    path: tuple[str, ...]
    sense: Sense
    bound: float


def parse_goals(texts: Sequence[str], sense: Sense) -> list[Goal]:
    """Goals from FIGURE=NUMBER, parts of a figure's path joined by dots.

    Raises:
        UsageError: it is not of that form.
    """
    goals = []
    for text in texts:
        name, _, number = text.partition("=")
        try:
            goals.append(Goal(tuple(name.split(".")), sense, float(number)))
        except ValueError:
            raise UsageError(f"'{text}' is no FIGURE=NUMBER", hint="lost.f1=0.9") from None
    return goals


def missed(scores: Mapping[str, Any], goals: Sequence[Goal]) -> list[str]:
    """One line for every goal that is not reached; a figure without a value misses it.

    Raises:
        UsageError: there is no such figure.
    """
    lines = []
    for goal in goals:
        found: Any = scores
        for part in goal.path:
            if not isinstance(found, Mapping) or part not in found:
                raise UsageError(f"there is no figure '{'.'.join(goal.path)}' in the results")
            found = found[part]
        value = found[0] if isinstance(found, list | tuple) and found else found
        if not isinstance(value, int | float | None):
            hint = ", ".join(found) if isinstance(found, Mapping) else None
            raise UsageError(f"'{'.'.join(goal.path)}' is no number", hint=hint)
        is_met = value is not None and (
            value >= goal.bound if goal.sense == ">=" else value <= goal.bound
        )
        if not is_met:
            told = "not known" if value is None else f"{value:.4g}"
            lines.append(f"{'.'.join(goal.path)} is {told}, wanted {goal.sense} {goal.bound:g}")
    return lines
