"""What a recipe sets of corridors and scores, and the logs that answer it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from slamreplay.labs.false_closures.corridors import CORRIDORS, round_trip
from slamreplay.labs.false_closures.pages import Key, results
from slamreplay.labs.false_closures.trials import Trial, closed, odometry_end_m
from slamreplay.labs.lab import Lab, LabResults, Progress
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.recording import record
from slamreplay.simulate.worlds import World

Score = Annotated[float, Field(ge=0.0, le=1.0)]


class FalseClosures(Lab):
    """False loop closures over min_score, by score alone and checked, with and without a kernel."""

    corridors: Annotated[list[Literal["common", "repetitive"]], Field(min_length=1, max_length=2)]
    min_score: Annotated[list[Score], Field(min_length=1, max_length=50)]
    textbook_score: Score
    again_m: Annotated[float, Field(ge=0.0, le=12.0)]
    logs: Annotated[int, Field(ge=1, le=200)]

    @model_validator(mode="after")
    def _fits(self) -> FalseClosures:
        if sorted(set(self.min_score)) != self.min_score:
            raise ValueError("min_score should ascend, each score once")
        if self.textbook_score not in self.min_score:
            raise ValueError("textbook_score should be one of min_score")
        if len(set(self.corridors)) != len(self.corridors):
            raise ValueError("corridors names one twice")
        return self

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Drive each corridor as often as asked for, and close every log in every way."""
        found: dict[Key, list[Trial]] = {}
        ends: dict[str, list[float]] = {corridor: [] for corridor in self.corridors}
        for k, corridor in enumerate(self.corridors):
            for log in range(self.logs):
                if progress:
                    done = (k + log / self.logs) / len(self.corridors)
                    progress(f"closing loops, {corridor} corridor", done)
                recording = record(round_trip(corridor, self.again_m, seed + log))
                view = bundle_of(recording).view()
                ends[corridor].append(odometry_end_m(recording))
                for checked in (False, True):
                    for score in self.min_score:
                        both = closed(view, recording, score, is_checked=checked)
                        for kernel, trial in zip((False, True), both, strict=True):
                            key = Key(corridor, checked, kernel, score)
                            found.setdefault(key, []).append(trial)
        worlds: dict[str, World] = {name: CORRIDORS[name]() for name in self.corridors}
        return results(found, ends, worlds, self.textbook_score)
