"""One filter's runs as numbers, and the words that the rules allow for them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from slamreplay.consistency.statistics.intervals import mean_interval
from slamreplay.geometry.se2 import Array
from slamreplay.labs.covariance_breathing.corridor import Chain, Drive, Wall
from slamreplay.labs.covariance_breathing.rules import Rules

#: Degrees of freedom: along and across.
DOF = 2
#: Single runs that a figure shows.
SHOWN = 30


@dataclass(frozen=True, eq=False)
class Chained:
    """Beliefs along the corridor without the runs behind them.

    Attributes:
        P: (K + 1, 2, 2) claimed covariances, m2.
        rms: (K + 1, 2) true errors along and across, root mean square over the runs, m.
        anees: (K + 1,) mean NEES over the runs.
        typical: (K + 1, 2) error of the run whose NEES on the way is the median at the end, m.
        errors: (K + 1, some runs, 2) of the first runs, m.
    """

    P: Array
    rms: Array
    anees: Array
    typical: Array
    errors: Array

    @property
    def sigma(self) -> Array:
        """(K + 1, 2) claimed along and across, m."""
        return np.sqrt(np.diagonal(self.P, axis1=1, axis2=2))


@dataclass(frozen=True, eq=False)
class Case:
    """One filter: which ranges it takes in, what noise it is told and what noise there is.

    Attributes:
        every_steps: how often ranges are taken in; None: never.
        walls: whose.
        told: process noise along the corridor as the filter has it, m2 a step.
        true: process noise along the corridor, m2 a step.
        before: beliefs on the way.
        after: beliefs after the closure, looking back.
        closure_nis: mean over the runs of the closure's squared innovation.
        growth: largest sigma along and across of the last quarter over that of the second.
        closure_leaves: of the last pose's sigma.
        closure_leaves_chain: of the sigma of all poses, root mean square; both looking back.
        interval: the mean NEES of a consistent filter lies in it.
        words: along, across, closure and belief in words.
    """

    every_steps: int | None
    walls: tuple[Wall, ...]
    told: float
    true: float
    before: Chained
    after: Chained
    closure_nis: float
    growth: tuple[float, float]
    closure_leaves: float
    closure_leaves_chain: float
    interval: tuple[float, float]
    words: dict[str, str]

    @property
    def updates(self) -> str:
        """The range updates in words."""
        if self.every_steps is None:
            return "never"
        often = (
            "every step" if self.every_steps == 1 else f"every {_ordinal(self.every_steps)} step"
        )
        return f"{often}, {' and '.join(self.walls)} wall"

    def numbers(self) -> dict[str, Any]:
        """What goes to results.json, to six digits."""
        low, high = self.interval
        out: dict[str, Any] = {
            "updates": self.updates,
            "every_steps": self.every_steps,
            "walls": list(self.walls),
            "told_process_noise_m2_per_step": self.told,
            "true_process_noise_m2_per_step": self.true,
        }
        for name, chain in (("before", self.before), ("after", self.after)):
            for axis, where in enumerate(("along", "across")):
                out[f"sigma_{where}_{name}_m"] = _six(chain.sigma[-1, axis])
                out[f"error_{where}_{name}_m"] = _six(chain.rms[-1, axis])
            out[f"anees_{name}"] = _six(chain.anees[-1])
            inside = float(np.mean((chain.anees >= low) & (chain.anees <= high)))
            out[f"steps_within_interval_{name}"] = _six(inside)
        return out | {
            "anees_low": _six(low),
            "anees_high": _six(high),
            "closure_mean_nis": _six(self.closure_nis),
            "growth_along": _six(self.growth[0]),
            "growth_across": _six(self.growth[1]),
            "error_growth_along": _six(_growth(self.before.rms)[0]),
            "closure_leaves": _six(self.closure_leaves),
            "closure_leaves_chain": _six(self.closure_leaves_chain),
            **self.words,
        }


def summarise(
    every_steps: int | None,
    walls: tuple[Wall, ...],
    told: float,
    true: float,
    driven: Drive,
    rules: Rules,
) -> Case:
    """The numbers of many runs, and what the rules call them."""
    nees = driven.filtered.nees()[-1]
    typical = int(np.argsort(nees, kind="stable")[len(nees) // 2])
    before, after = _chained(driven.filtered, typical), _chained(driven.closed, typical)
    growth = _growth(before.sigma)
    spread, held = (np.trace(c.P, axis1=1, axis2=2) for c in (driven.smoothed, driven.closed))
    leaves = math.sqrt(held[-1] / spread[-1])
    leaves_chain = math.sqrt(held.mean() / spread.mean())
    interval = mean_interval(DOF, len(driven.closure_nis), rules.interval_miss_probability)
    snaps = leaves <= rules.tight_to_ratio and leaves_chain <= rules.tight_to_chain_ratio
    words = {
        name: "grows without bound" if ratio >= rules.grows_from_ratio else "stays bounded"
        for name, ratio in zip(("along", "across"), growth, strict=True)
    }
    words["closure"] = "snaps tight" if snaps else "changes little"
    words["belief"] = _credit(float(before.anees[-1]), interval, rules)
    return Case(
        every_steps, walls, told, true, before, after, float(driven.closure_nis.mean()), growth,
        leaves, leaves_chain, interval, words,
    )  # fmt: skip


def _chained(chain: Chain, typical: int) -> Chained:
    return Chained(
        P=chain.P,
        rms=np.sqrt(np.mean(chain.error**2, axis=1)),
        anees=chain.nees().mean(axis=1),
        typical=chain.error[:, typical].copy(),
        errors=chain.error[:, :SHOWN].copy(),
    )


def _growth(sigma: Array) -> tuple[float, float]:
    """Largest of the last quarter of the way over largest of the second, along and across."""
    quarter = (len(sigma) - 1) // 4
    late = sigma[-quarter:].max(axis=0)
    early = sigma[quarter + 1 : 2 * quarter + 1].max(axis=0)
    return float(late[0] / early[0]), float(late[1] / early[1])


def _credit(anees: float, interval: tuple[float, float], rules: Rules) -> str:
    """What the mean NEES of the last pose on the way says of the belief."""
    low, high = interval
    if low <= anees <= high:
        return "consistent"
    if anees < low:
        return "underconfident"
    is_far = math.sqrt(anees / DOF) >= rules.collapsed_from_sigmas
    return "collapsed" if is_far else "overconfident"


def _six(value: float) -> float:
    return float(f"{value:.6g}")


def _ordinal(n: int) -> str:
    teen = 10 <= n % 100 <= 20
    return f"{n}{'th' if teen else {1: 'st', 2: 'nd', 3: 'rd'}.get(n % 10, 'th')}"
