"""Over the curves of a design: what broke first, each measured by the range that was tried."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slamreplay.replay.dose import Critical, DoseCurve, DoseResults


@dataclass(frozen=True)
class Margin:
    """How far one perturbation could be turned up before an estimator broke.

    Levels in s, m, deg and ratios have no common scale. What two of them share is how far each was
    turned up in this design, so that a margin is no better than the ranges a recipe chose.

    Attributes:
        estimator: whose.
        perturbation: `NAME.VARIANT`.
        unit: of the level.
        metric: whose limit was crossed at the least level; None where all held.
        level: at which it was; None where all held.
        share: of the range from the baseline to the farthest level tried, of a scale in logarithms;
            None where all held.
        is_partly: whether fewer than half of the seeds crossed one.
        held_to: the farthest level known to hold, where no seed crossed any; None otherwise.
        is_whole: whether that is the farthest level tried.
        undisturbed: metrics beyond their limits undisturbed, which therefore have no part in it.
    """

    estimator: str
    perturbation: str
    unit: str
    metric: str | None
    level: float | None
    share: float | None
    is_partly: bool
    held_to: float | None
    is_whole: bool
    undisturbed: tuple[str, ...]


def ranking(results: DoseResults) -> tuple[Margin, ...]:
    """Every curve there is, the least margin first; those that held are last."""
    margins = [_margin(curve) for curve in results.curves if curve.responses]
    return tuple(sorted(margins, key=lambda m: (m.share is None, m.share or 0.0)))


def critical_of_first(curve: DoseCurve) -> Critical | None:
    """The critical level of what broke first; None where nothing did."""
    return next((c for c in curve.critical if c.metric == curve.broke_first), None)


def _margin(curve: DoseCurve) -> Margin:
    first = critical_of_first(curve)
    level = None if first is None else first.level
    share = (
        None
        if level is None
        else _turned_up(curve, level) / _turned_up(curve, curve.responses[-1].level)
    )
    already = tuple(c.metric for c in curve.critical if c.outcome == "always")
    outcomes = [c.outcome for c in curve.critical]
    is_partly = level is None and "partly" in outcomes
    held = [c.low for c in curve.critical if c.outcome == "never" and c.low is not None]
    held_to = min(held, key=lambda v: abs(v - curve.baseline), default=None)
    held_to = None if is_partly or level is not None else held_to
    is_whole = held_to == curve.responses[-1].level
    return Margin(curve.estimator, curve.perturbation, curve.unit, curve.broke_first, level, share,
                  is_partly, held_to, is_whole, already)  # fmt: skip


def _turned_up(curve: DoseCurve, level: float) -> float:
    """How far a level is from the baseline, of a scale by its logarithm."""
    if curve.is_scale:
        return abs(math.log(level / curve.baseline))
    return abs(level - curve.baseline)
