"""From likelihoods to probabilities: a temperature, and what each trial is worth by itself."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from types import MappingProxyType

import numpy as np

from slamreplay.rootcause.trying import Tried
from slamreplay.verdict.judgement import FailureKind

#: Probability that what happened is none of what was tried, shared evenly: simulations cannot tell
#: 0.99 from 0.999, and real logs fail in ways that none shows.
UNFORESEEN = 0.02


@dataclass(frozen=True)
class Calibration:
    """A conditional logit over what was tried (McFadden, 1974).

    Attributes:
        slope: of the log likelihood: one over the temperature.
        bias: what is added to a trial's score, by `key_of`; nats.
        rule: what is added where the verdict's own failure mode is of the trial's kind; nats.
    """

    slope: float = 0.5
    bias: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    rule: float = 0.0

    def probabilities(self, tried: Sequence[Tried], rule: FailureKind) -> list[float]:
        """Of each trial; they sum to 1.

        Args:
            tried: with their likelihoods.
            rule: the verdict's failure mode, which no replay was asked for.
        """
        trials = [(key_of(t), t.trial.kind, t.log_likelihood) for t in tried]
        return self.shares(trials, rule)

    def shares(
        self, trials: Sequence[tuple[str, FailureKind, float]], rule: FailureKind
    ) -> list[float]:
        """The same of trials told by key, kind and log likelihood."""
        scores = np.array(
            [
                self.slope * value + self.bias.get(key, 0.0) + (self.rule if kind == rule else 0.0)
                for key, kind, value in trials
            ]
        )
        chance = np.exp(scores - scores.max())
        chance = (1.0 - UNFORESEEN) * chance / chance.sum() + UNFORESEEN / len(chance)
        return [float(p) for p in chance]


def key_of(tried: Tried) -> str:
    """What a trial is called in the calibration: the kind, and the perturbation if it has one."""
    trial = tried.trial
    return f"{trial.kind} {trial.name.partition('.')[0]}".strip()


def shipped_calibration() -> Calibration:
    """The one that this version ships with."""
    file = files("slamreplay.rootcause").joinpath("calibration.json")
    if not file.is_file():
        return Calibration()
    record = json.loads(file.read_text("utf-8"))
    return Calibration(record["slope"], record["bias"], record["rule"])
