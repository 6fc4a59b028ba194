"""SR-CON-008: does a sensor measure too much or too little all along?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtr, stdtrit

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.answers import Suspicion
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.innovations.innovation_sets import InnovationSet, innovation_sets
from slamreplay.consistency.statistics.effective_samples import effective_samples
from slamreplay.consistency.statistics.mean_test import N_EFF_MIN, NOMINAL

#: In sigmas of the innovation: a bias below this is lost in the noise (4 % of the NIS), one of a
#: whole sigma doubles the NIS.
SLIGHT, GROSS = 0.2, 1.0


@dataclass(frozen=True)
class Bias:
    """The mean of a correlated series, with its 95 % interval.

    Attributes:
        mean: in the unit of the series.
        low: lower end.
        high: upper end.
        p_value: two-sided, of a mean of zero.
        n: samples.
        n_eff: independent ones among them.
    """

    mean: float
    low: float
    high: float
    p_value: float
    n: int
    n_eff: float


def bias_of(series: ArrayLike) -> Bias:
    """Student's t for the mean of a series (N,), N >= 2, with effective samples for samples."""
    x = np.asarray(series, dtype=np.float64)
    n, n_eff, mean = len(x), effective_samples(x), float(np.mean(x))
    dof = max(n_eff - 1.0, 1.0)
    error = float(np.std(x, ddof=1)) / math.sqrt(n_eff)
    half = float(stdtrit(dof, 1.0 - NOMINAL / 2.0)) * error
    p = 2.0 * float(stdtr(dof, -abs(mean) / error)) if error > 0.0 else float(mean == 0.0)
    return Bias(mean, mean - half, mean + half, p, n, n_eff)


def check(context: CheckContext) -> tuple[Suspicion, ...]:
    """SR-CON-008 by source and axis, where there are enough independent innovations."""
    answers = []
    for seen in innovation_sets(context.innovations):
        if seen.accepted.sum() < N_EFF_MIN:
            continue
        for axis in range(len(seen.axes)):
            bias = bias_of(seen.residual[seen.accepted, axis])
            if bias.n_eff >= N_EFF_MIN:
                answers.append(_suspicion(seen, axis, bias))
    return tuple(answers)


def _suspicion(seen: InnovationSet, axis: int, bias: Bias) -> Suspicion:
    name, unit = seen.axes[axis], seen.units[axis]
    sigma = math.sqrt(float(np.mean(seen.sigma[seen.accepted, axis] ** 2)))
    effect = abs(bias.mean) / sigma
    large: Severity = "error" if effect >= GROSS else "warning"
    more, sign = ("more", 1.0) if bias.mean >= 0.0 else ("less", -1.0)
    shown, factor = readable(unit, bias.mean)
    low, high = sorted(sign * factor * end for end in (bias.low, bias.high))
    text = (
        f"{seen.source} measures {abs(factor * bias.mean):.3g}{shown} {more} {name} than "
        f"predicted on average (95 % {low:.3g} to {high:.3g}{shown}), {effect:.2g} of its sigma; "
        f"{bias.n} innovations are worth {bias.n_eff:.0f} independent ones"
    )
    finding = Finding(
        "SR-CON-008",
        "info" if effect < SLIGHT else large,
        text,
        start_ns=int(seen.t_ns[0]),
        end_ns=int(seen.t_ns[-1]),
        value=bias.mean,
        low=bias.low,
        high=bias.high,
        unit=unit,
        n=bias.n,
        n_eff=bias.n_eff,
    )
    return Suspicion(finding, bias.p_value)


def readable(unit: str, size: float) -> tuple[str, float]:
    """The unit people read a size in, with a space before it, and the factor to it."""
    if unit == "m" and abs(size) < 1.0:
        return " cm", 100.0
    if unit in ("rad", "rad/s"):
        return f" {unit.replace('rad', 'deg')}", math.degrees(1.0)
    return (f" {unit}" if unit else ""), 1.0
