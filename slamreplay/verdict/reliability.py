"""How often what was said with a confidence was right: the record that every report shows.

`reliability.json` beside this module was written by `slamreplay bench verdict` on held seeds, which
nothing of the program was tuned on. It is a measurement and changes no verdict.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files
from typing import Any


@dataclass(frozen=True)
class Bin:
    """Moments whose confidence lies in [low, high).

    Attributes:
        said: mean confidence, 0 to 1.
        right: share of the moments whose state was the true one, 0 to 1.
        moments: how many.
        logs: from how many logs; moments of one log are alike.
    """

    low: float
    high: float
    said: float
    right: float
    moments: int
    logs: int


@dataclass(frozen=True)
class Reliability:
    """A reliability diagram as numbers (Murphy and Winkler, 1977).

    Attributes:
        logs: simulated logs played.
        seed: of the benchmark.
        ece: expected calibration error (Naeini et al., 2015), None without a moment.
        bins: those with a moment in them, by rising confidence.
    """

    logs: int
    seed: int
    ece: float | None
    bins: tuple[Bin, ...]

    @property
    def moments(self) -> int:
        """In all bins."""
        return sum(b.moments for b in self.bins)

    def bin_of(self, confidence: float) -> Bin | None:
        """Where a confidence falls; None where nothing was ever said with it."""
        return next((b for b in self.bins if b.low <= confidence < b.high), None)

    def as_json(self) -> dict[str, Any]:
        """As `reliability.json` holds it."""
        return asdict(self)


def reliability_of(record: Mapping[str, Any]) -> Reliability:
    """The record that `Reliability.as_json` wrote."""
    bins = tuple(Bin(**b) for b in record["bins"])
    return Reliability(record["logs"], record["seed"], record["ece"], bins)


def measured_reliability() -> Reliability:
    """The record this version ships with."""
    text = files("slamreplay.verdict").joinpath("reliability.json").read_text("utf-8")
    return reliability_of(json.loads(text))
