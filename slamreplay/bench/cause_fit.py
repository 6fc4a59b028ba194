"""The calibration of root causes, fitted to incidents to develop with.

A conditional logit (McFadden: Conditional logit analysis of qualitative choice behavior, 1974):
each trial of an incident is a choice with a score, the log likelihood times a slope plus what such
a trial is worth by itself, and the chosen ones are those whose kind is a right answer. Small
samples must not run away: slope and offsets are drawn to a prior.

`python -m slamreplay.bench.cause_fit SEED...` plays every kind of incident with these seeds and
prints the record that `slamreplay.rootcause.calibration` ships with.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slamreplay.bench.cause_scores import counted
from slamreplay.bench.incidents import ALL_KINDS, incident
from slamreplay.bench.known_cause import known_cause
from slamreplay.bench.logs import bundle_of
from slamreplay.bench.schedule import Case
from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.rootcause.answer import trials_and_mode
from slamreplay.rootcause.calibration import Calibration, key_of
from slamreplay.verdict.judgement import FailureKind

#: Prior of the slope, its weight on the logarithm's square, and that of offsets on theirs.
_SLOPE, _SLOPE_WEIGHT, _OFFSET_WEIGHT = 0.5, 4.0, 0.05
#: Parts that each part is tested on the fit to the others.
FOLDS = 5


@dataclass(frozen=True)
class Played:
    """An incident of known cause whose trials were replayed.

    Attributes:
        seed: of it; folds are of seeds.
        accepted: right answers.
        rule: the verdict's failure mode, without replays.
        trials: key, kind and log likelihood of each.
    """

    seed: int
    accepted: tuple[str, ...]
    rule: FailureKind
    trials: tuple[tuple[str, FailureKind, float], ...]


def played(case: Case) -> Played | None:
    """Play one; None where nothing of known cause happened, or nothing can be replayed."""
    made = incident(case.kind, case.seed, case.conditions)
    bundle, truth = bundle_of(made)
    known = known_cause(made, truth)
    if not known.is_incident:
        return None
    view = bundle.view()
    belief = recorded_belief(view, belief_times(view))
    found = trials_and_mode(view, belief, hindsight(view))
    if found is None:
        return None
    tried, rule = found
    trials = tuple((key_of(t), t.trial.kind, t.log_likelihood) for t in tried)
    return Played(case.seed, tuple(known.accepted), rule, trials)


def fitted(cases: Sequence[Played]) -> Calibration:
    """The calibration that makes the right answers most likely."""
    from scipy.optimize import minimize

    usable = [c for c in cases if any(kind in c.accepted for _, kind, _ in c.trials)]
    keys = sorted({key for c in usable for key, _, _ in c.trials})

    def of(p: np.ndarray) -> Calibration:
        return Calibration(float(np.exp(p[0])), dict(zip(keys, p[2:].tolist(), strict=True)), p[1])

    def cost(p: np.ndarray) -> float:
        weights = of(p)
        lost = -sum(np.log(_right(weights, c)) for c in usable)
        prior = _SLOPE_WEIGHT * (p[0] - np.log(_SLOPE)) ** 2
        return float(lost + prior + _OFFSET_WEIGHT * (p[1:] ** 2).sum())

    start = np.zeros(2 + len(keys))
    start[0] = np.log(_SLOPE)
    best = minimize(cost, start, method="L-BFGS-B").x
    return of(np.round(best, 3))


def _right(weights: Calibration, case: Played) -> float:
    chance = weights.shares(case.trials, case.rule)
    return sum(p for p, (_, kind, _) in zip(chance, case.trials, strict=True)
               if kind in case.accepted)  # fmt: skip


def said(weights: Calibration, case: Played) -> tuple[str, float]:
    """The kind named and its probability."""
    by_kind: dict[str, float] = {}
    for p, (_, kind, _) in zip(weights.shares(case.trials, case.rule), case.trials, strict=True):
        by_kind[kind] = by_kind.get(kind, 0.0) + p
    name = max(by_kind, key=lambda kind: by_kind[kind])
    return name, by_kind[name]


def record_of(cases: Sequence[Played]) -> dict[str, Any]:
    """The fit to all, and what it was worth on seeds it was not fitted to, as JSON."""
    answers = []
    for fold in range(FOLDS):
        weights = fitted([c for c in cases if c.seed % FOLDS != fold])
        answers += [(*said(weights, c), c) for c in cases if c.seed % FOLDS == fold]
    right = np.array([name in c.accepted for name, _, c in answers])
    p = np.array([p for _, p, _ in answers])
    at = np.minimum((10 * p).astype(int), 9)
    gap = [abs(float(p[at == k].sum()) - int(right[at == k].sum())) for k in range(10)]
    whole = fitted(cases)
    return {
        "slope": whole.slope,
        "rule": whole.rule,
        "bias": dict(whole.bias),
        "incidents": len(cases),
        "seeds": sorted({c.seed for c in cases}),
        "cross_validated": {
            "right": int(right.sum()),
            "interval": counted(int(right.sum()), len(right))[1:],
            "ece": sum(gap) / max(len(p), 1),
        },
    }


def main(seeds: Sequence[int], kinds: Sequence[str]) -> str:
    """The record of incidents of these kinds and seeds, as text."""
    cases = [played(Case(kind, seed)) for seed in seeds for kind in kinds]
    record = record_of([c for c in cases if c is not None])
    return json.dumps(record, indent=1, sort_keys=True) + "\n"


if __name__ == "__main__":
    print(main([int(text) for text in sys.argv[1:]], ALL_KINDS), end="")  # noqa: T201
