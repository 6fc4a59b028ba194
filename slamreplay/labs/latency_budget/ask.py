"""What a budget recipe sets."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from slamreplay.errors import UsageError
from slamreplay.labs.lab import GivenName, Strict

Seconds = Annotated[float, Field(ge=0.001, le=10.0)]
Hertz = Annotated[float, Field(ge=0.1, le=1000.0)]


class Stage(Strict):
    """One more stage in front of the localizer's answer."""

    name: GivenName
    stage_s: Seconds


class Gate(Strict):
    """When a stage is too long for the room there is."""

    still_allowed_ratio: Annotated[float, Field(gt=0.0, lt=1.0)]
    longest_stage_s: Seconds


class Replayed(Strict):
    """An estimator that is run with each stage's delay as a perturbation."""

    estimator: Annotated[str, Field(min_length=1, max_length=100)]
    perturbation: Annotated[str, Field(min_length=1, max_length=100)]

    @field_validator("perturbation")
    @classmethod
    def _is_a_delay(cls, name: str) -> str:
        from slamreplay.perturb import PERTURBATIONS

        kind, _, variant = name.partition(".")
        try:
            variants = PERTURBATIONS.load(kind).variants
        except UsageError as error:
            raise ValueError(f"is no perturbation: {error.what}") from error
        if variant not in variants:
            raise ValueError(f"should be one of {', '.join(f'{kind}.{v}' for v in variants)}")
        if variants[variant].unit != "s":
            raise ValueError("should be a delay, with a level in s")
        return name


class Budget(Strict):
    """Budgets, stages, and what turns motion into an error."""

    controller_hz: Hertz
    planner_hz: Hertz
    lever_m: Annotated[float, Field(ge=0.0, le=100.0)]
    odometry_error_ratio: Annotated[float, Field(ge=0.0, le=1.0)]
    stages: Annotated[list[Stage], Field(min_length=1, max_length=20)]
    gate: Gate
    replayed: Annotated[list[Replayed], Field(max_length=20)]
