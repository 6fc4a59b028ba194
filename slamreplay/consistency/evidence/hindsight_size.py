"""How large hindsight's own covariance ought to be, as simulated logs of known truth show it.

`hindsight_size.json` beside this module was written by `slamreplay bench verdict --train`, on seeds
that are there to develop with.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from slamreplay.bundle.track import PoseTrack


@dataclass(frozen=True)
class HindsightSize:
    """Factors k = sqrt(mean NEES / degrees of freedom) of hindsight's sigma: too small by k.

    Each log has a factor of its own, for the errors within one are alike.

    Attributes:
        logs: simulated logs in which hindsight had a place.
        seed: of the benchmark.
        split: train or held.
        position: of x and y, over the mean NEES of all logs, each counted alike.
        heading: the same of the heading.
        typical_position: of the median log.
        typical_heading: the same of the heading.
        most_position: 95 % of the logs have no larger one.
        most_heading: the same of the heading.
    """

    logs: int
    seed: int
    split: str
    position: float
    heading: float
    typical_position: float
    typical_heading: float
    most_position: float
    most_heading: float

    def as_json(self) -> dict[str, Any]:
        """As `hindsight_size.json` holds it."""
        return asdict(self)

    @property
    def inflation(self) -> tuple[float, float]:
        """Factors of the sigma of position and heading that evidence is made with, 1 or more.

        Those of 95 % of the logs: a belief is held against one log, and in the few that hindsight
        placed badly the mean of all would accuse it. A covariance that was too large for simulated
        logs is not made smaller: maps of the field are worse than theirs.
        """
        return max(1.0, self.most_position), max(1.0, self.most_heading)

    @property
    def words(self) -> str:
        """What was done to hindsight's covariance, and why."""
        parts = zip(("position", "heading"), self.inflation, strict=True)
        grown = [f"by {k:.2g} in {name}" for name, k in parts if k > 1.0]
        logs = f"95 % of {self.logs} simulated logs"
        if not grown:
            return f"hindsight's sigma was taken as it is: {logs} erred by no more"
        factors = " and ".join(grown)
        return f"hindsight's sigma was inflated {factors}, its calibrated size in {logs}"


def hindsight_size_of(record: Mapping[str, Any]) -> HindsightSize:
    """The record that `HindsightSize.as_json` wrote."""
    return HindsightSize(**record)


@cache
def measured_hindsight_size() -> HindsightSize:
    """The record this version ships with."""
    text = (
        files("slamreplay.consistency.evidence").joinpath("hindsight_size.json").read_text("utf-8")
    )
    return hindsight_size_of(json.loads(text))


def inflated(track: PoseTrack, size: HindsightSize) -> PoseTrack:
    """Hindsight's track (N rows) with its covariance as large as it ought to be."""
    position, heading = size.inflation
    by = np.array([position, position, heading])
    cov = track.cov * by[:, None] * by
    return PoseTrack(track.frame_id, track.child_frame_id, track.t_ns, track.xyyaw, cov)
