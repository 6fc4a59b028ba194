"""What a recipe sets of the corridor, and the runs that answer it."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from slamreplay.labs.covariance_breathing.cases import Case, summarise
from slamreplay.labs.covariance_breathing.corridor import Corridor, drive
from slamreplay.labs.covariance_breathing.pages import results
from slamreplay.labs.covariance_breathing.rules import Rules
from slamreplay.labs.lab import Lab, LabResults, Progress, Strict

Metres = Annotated[float, Field(gt=0.0, le=1e4)]
Noise = Annotated[float, Field(ge=1e-9, le=1e3)]

#: Poses of all runs of one filter: more would fill the memory.
MOST_POSES = 1_000_000


class Update(Strict):
    """How often ranges are taken in, and to which walls; `every_steps: null` is never."""

    every_steps: Annotated[int, Field(ge=1)] | None
    walls: list[Literal["side", "end"]]

    @model_validator(mode="after")
    def _whole(self) -> Update:
        if bool(self.walls) != (self.every_steps is not None):
            raise ValueError(
                "walls should be named where every_steps is a number, and [] where it is null"
            )
        if len(set(self.walls)) != len(self.walls):
            raise ValueError("walls names one twice")
        return self


class Collapse(Strict):
    """The filter is told less process noise than there is."""

    told_process_noise_m2_per_step: Noise
    true_process_noise_m2_per_step: Noise

    @model_validator(mode="after")
    def _too_small(self) -> Collapse:
        if self.told_process_noise_m2_per_step >= self.true_process_noise_m2_per_step:
            raise ValueError("told_process_noise_m2_per_step should be smaller than the true one")
        return self


class CovarianceBreathing(Lab):
    """Kalman filter down a corridor: growth, range updates, one loop closure, and collapse."""

    corridor_m: Metres
    corridor_width_m: Metres
    step_m: Metres
    process_noise_m2_per_step: Annotated[list[Noise], Field(min_length=1, max_length=12)]
    across_to_along_variance: Annotated[float, Field(gt=0.0, le=10.0)]
    start_sigma_m: Annotated[float, Field(ge=1e-6, le=10.0)]
    range_sigma_m: Annotated[float, Field(ge=1e-6, le=10.0)]
    updates: Annotated[list[Update], Field(min_length=1, max_length=8)]
    closure_sigma_m: Annotated[float, Field(ge=1e-6, le=10.0)]
    collapse: Collapse
    rules: Rules
    runs: Annotated[int, Field(ge=2, le=100_000)]

    @property
    def steps(self) -> int:
        """How many steps the corridor takes."""
        return round(self.corridor_m / self.step_m)

    @model_validator(mode="after")
    def _fits(self) -> CovarianceBreathing:
        steps = self.corridor_m / self.step_m
        if not 8 <= steps <= 10_000 or not math.isclose(steps, round(steps), rel_tol=1e-9):
            raise ValueError("corridor_m should be a whole number of step_m, from 8 to 10000")
        if self.steps * self.runs > MOST_POSES:
            raise ValueError(f"steps times runs should be at most {MOST_POSES}")
        if any(4 * (u.every_steps or 0) > self.steps for u in self.updates):
            raise ValueError("every_steps should be at most a quarter of the steps")
        if self.collapse.true_process_noise_m2_per_step not in self.process_noise_m2_per_step:
            raise ValueError(
                "collapse.true_process_noise_m2_per_step should be one of process_noise_m2_per_step"
            )
        if len(set(self.process_noise_m2_per_step)) != len(self.process_noise_m2_per_step):
            raise ValueError("process_noise_m2_per_step names a noise twice")
        if any(update in self.updates[:k] for k, update in enumerate(self.updates)):
            raise ValueError("updates names one twice")
        return self

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Every update with every process noise told as it is, then with a noise told wrongly."""
        corridor = Corridor(
            steps=self.steps,
            step_m=self.step_m,
            width_m=self.corridor_width_m,
            start_sigma_m=self.start_sigma_m,
            range_sigma_m=self.range_sigma_m,
            closure_sigma_m=self.closure_sigma_m,
        )
        share = np.array([1.0, self.across_to_along_variance])
        wrong = self.collapse
        noises = [(q, q) for q in self.process_noise_m2_per_step]
        noises.append((wrong.told_process_noise_m2_per_step, wrong.true_process_noise_m2_per_step))
        cases: list[Case] = []
        for update in self.updates:
            if progress:
                progress("driving", len(cases) / (len(self.updates) * len(noises)))
            for told, true in noises:
                driven = drive(
                    corridor,
                    told * share,
                    true * share,
                    update.every_steps,
                    tuple(update.walls),
                    self.runs,
                    np.random.default_rng([seed, len(cases)]),
                )
                what = (update.every_steps, tuple(update.walls), told, true)
                cases.append(summarise(*what, driven, self.rules))
        return results(corridor, cases, self.rules, self.runs)
