"""What a recipe sets, and the post-mortems of the logs from which a part is missing."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from slamreplay.labs.lab import Lab, LabResults, Progress
from slamreplay.labs.minimum_replay.pages import Row, results
from slamreplay.labs.minimum_replay.parts import recorded
from slamreplay.labs.minimum_replay.questions import QUESTIONS
from slamreplay.postmortem import postmortem
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import scenario

_Log = Literal["lost_robot", "wheel_slip", "kidnapped", "changed_aisle", "lost_in_changed_aisle"]
_Part = Literal["odometry", "imu", "scans", "pose", "covariance", "map", "costmap", "recovery"]


class MinimumReplay(Lab):
    """Logs without one of the eight parts of a replay bundle: which answers are lost."""

    logs: Annotated[list[_Log], Field(min_length=1, max_length=5)]
    parts: Annotated[list[_Part], Field(min_length=1, max_length=8)]

    @model_validator(mode="after")
    def _told_apart(self) -> MinimumReplay:
        for name in ("logs", "parts"):
            given = getattr(self, name)
            if len(set(given)) != len(given):
                raise ValueError(f"{name} names one twice")
        return self

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Record each story once, and write, read and judge it without each part in turn."""
        rows: list[Row] = []
        of = len(self.logs) * (1 + len(self.parts))
        for log in self.logs:
            recording = record(scenario(log), seed)
            for part in (None, *self.parts):
                if progress:
                    progress("looking back", len(rows) / of)
                bundle = bundle_of(recording, edit=recorded(part))
                post = postmortem(bundle, scene=False)
                answers = {name: ask(post, recording) for name, ask in QUESTIONS.items()}
                rows.append(Row(log, part, answers, tuple(bundle.manifest.missing_parts())))
        return results(rows, {log: scenario(log).verdict for log in self.logs})
