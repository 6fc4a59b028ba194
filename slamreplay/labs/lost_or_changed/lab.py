"""What a recipe sets of the worlds, and the post-mortems that answer it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from slamreplay.labs.lab import Lab, LabResults, Progress, Strict
from slamreplay.labs.lost_or_changed.drive import BOXES, RACKS, healthy, with_one_difference
from slamreplay.labs.lost_or_changed.pages import results
from slamreplay.labs.lost_or_changed.trials import Trial, trial

_Metres = Annotated[float, Field(gt=0.0, le=10.0)]
_Seconds = Annotated[float, Field(gt=0.0, le=8.0)]
_Boxes = Annotated[int, Field(ge=1, le=BOXES)]
#: Moved farther, a rack would stand in the way.
_Moved = Annotated[float, Field(gt=0.0, le=0.7)]


class Levels(Strict):
    """How much of each difference is tried, from little to much."""

    wrong_start_m: list[_Metres]
    slip_s: list[_Seconds]
    carried_m: list[Annotated[float, Field(gt=0.0, le=7.0)]]
    boxes: list[_Boxes]
    racks_removed: list[Annotated[int, Field(ge=1, le=RACKS)]]
    racks_moved_m: list[_Moved]
    boxes_and_wrong_start: list[_Boxes]

    @model_validator(mode="after")
    def _growing(self) -> Levels:
        for name in type(self).model_fields:
            levels: Sequence[float] = getattr(self, name)
            if not levels or np.any(np.diff(levels) <= 0.0):
                raise ValueError(f"{name} should be levels that grow")
        return self


class LostOrChanged(Lab):
    """One drive in worlds that differ in one thing: what parts lost from changed, and from when."""

    differences: Annotated[
        list[
            Literal["wrong_start_m", "slip_s", "carried_m", "boxes", "racks_removed",
                    "racks_moved_m", "boxes_and_wrong_start"]
        ],
        Field(min_length=1, max_length=7),
    ]  # fmt: skip
    levels: Levels
    logs: Annotated[int, Field(ge=1, le=100)]

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Drive every world as often as asked for, and hold a post-mortem on each log."""
        worlds = [("", 0.0)]
        worlds += [
            (what, float(n)) for what in self.differences for n in getattr(self.levels, what)
        ]
        trials: list[Trial] = []
        for log in range(seed, seed + self.logs):
            for what, level in worlds:
                if progress:
                    progress("driving", len(trials) / (len(worlds) * self.logs))
                story = healthy()
                if what:
                    story = with_one_difference(story, what, level, log)
                trials.append(trial(story, what, level, log))
        return results(trials)
