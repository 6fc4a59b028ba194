"""What a recipe sets of the two runs, and the logs that answer it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.labs.lab import GivenName, Lab, LabResults, Progress, Strict
from slamreplay.labs.two_run.hall import drive_out, evidence_of
from slamreplay.labs.two_run.pages import results
from slamreplay.labs.two_run.rules import Rules
from slamreplay.labs.two_run.trials import Course, localise

Particles = Annotated[int, Field(ge=10, le=100_000)]


class Start(Strict):
    """One run: its name, where the filter starts, and its particles under nav2_amcl's names."""

    name: GivenName
    start: Literal["clicked", "anywhere"]
    min_particles: Particles
    max_particles: Particles

    @model_validator(mode="after")
    def _ordered(self) -> Start:
        if self.min_particles > self.max_particles:
            raise ValueError("min_particles should not be above max_particles")
        return self


class TwoRun(Lab):
    """AMCL from a right prior and from anywhere, in a hall with two equal bays."""

    runs: Annotated[list[Start], Field(min_length=1, max_length=6)]
    rules: Rules
    logs: Annotated[int, Field(ge=1, le=200)]

    @model_validator(mode="after")
    def _told_apart(self) -> TwoRun:
        if len({run.name for run in self.runs}) != len(self.runs):
            raise ValueError("runs names one twice")
        return self

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Drive as many logs as asked for, and run every start on each."""
        courses: dict[str, list[Course]] = {run.name: [] for run in self.runs}
        for log in range(seed, seed + self.logs):
            if progress:
                progress("localizing", (log - seed) / self.logs)
            recording = drive_out(log)
            view = evidence_of(recording)
            for run in self.runs:
                config = AmclConfig(
                    min_particles=run.min_particles, max_particles=run.max_particles
                )
                anywhere = run.start == "anywhere"
                courses[run.name].append(
                    localise(view, recording, config, anywhere=anywhere, rules=self.rules, seed=log)
                )
        return results(courses, self.rules, seed)
