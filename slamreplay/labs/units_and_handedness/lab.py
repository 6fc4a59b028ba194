"""What a recipe asks: which confusions, of which estimators."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from slamreplay.errors import NotApplicableError
from slamreplay.labs.lab import Lab, LabResults, Progress
from slamreplay.labs.minimum_replay.parts import recorded
from slamreplay.labs.units_and_handedness.pages import results
from slamreplay.labs.units_and_handedness.trials import Confused, confused
from slamreplay.perturb import PERTURBATIONS
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import scenario

_FAMILIES = ("unit_error", "handedness", "quaternion_order", "frame_swap")
_Estimator = Literal["dead_reckoning", "ekf", "amcl", "scan_matching", "pose_graph"]


class UnitsAndHandedness(Lab):
    """Confusions of units, hands and frames on a healthy log: what breaks, and who finds it."""

    confusions: Annotated[list[str], Field(min_length=1, max_length=40)]
    estimators: Annotated[list[_Estimator], Field(min_length=1, max_length=5)]

    @model_validator(mode="after")
    def _known(self) -> UnitsAndHandedness:
        there = [f"{name}.{variant}" for name in _FAMILIES
                 for variant in PERTURBATIONS.load(name).variants]  # fmt: skip
        for name in self.confusions:
            if name not in there:
                raise ValueError(f"there is no confusion {name[:60]!r}")
        if len(set(self.confusions)) != len(self.confusions):
            raise ValueError("confusions names one twice")
        return self

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """One healthy drive, and the log of it with each confusion in turn."""
        recording = record(scenario("healthy"), seed)
        bundle = bundle_of(recording, edit=recorded(None))
        found: dict[str | None, Confused] = {}
        for k, name in enumerate((None, *self.confusions)):
            if progress:
                progress("confusing", k / (1 + len(self.confusions)))
            try:
                found[name] = confused(name, bundle, recording, self.estimators, seed)
            except NotApplicableError:
                continue
        return results(found)
