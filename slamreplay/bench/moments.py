"""Moments of a recorded log compared: truly lost by definition, said by the verdict, scored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bench.real_faults import Flags
from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns
from slamreplay.simulate.truth import in_stretches
from slamreplay.verdict.judgement import Judgement
from slamreplay.verdict.limits import Limits

#: Moments this near to a true edge belong to neither side.
_EDGE_S = 0.5


@dataclass(frozen=True)
class Score:
    """Moments rightly found, found in vain, and missed."""

    hits: int
    false: int
    missed: int

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall; None where there was nothing to find or say."""
        whole = 2 * self.hits + self.false + self.missed
        return 2 * self.hits / whole if whole else None


def scored(t_ns: NDArray[np.int64], true: Flags, said: Flags, counted: Flags) -> Score:
    """Moments compared; those near an edge of the truth or of what is counted are left out."""
    changes = (true[1:] != true[:-1]) | (counted[1:] != counted[:-1])
    edges = t_ns[np.flatnonzero(changes) + 1]
    near = np.zeros(len(t_ns), dtype=bool)
    for edge in edges:
        near |= np.abs(t_ns - edge) <= ns(_EDGE_S)
    a, b = true[counted & ~near], said[counted & ~near]
    return Score(int((a & b).sum()), int((~a & b).sum()), int((a & ~b).sum()))


def true_lost(view: BundleView, t_ns: NDArray[np.int64], true: se2.Array) -> Flags:
    """(N,) whether the belief is off the true poses (N, 3) for long enough, by definition."""
    limits = Limits()
    belief = recorded_belief(view, t_ns)
    if belief is None:
        return np.zeros(len(t_ns), dtype=bool)
    apart = belief.xyyaw - true
    with np.errstate(invalid="ignore"):
        off = np.hypot(apart[:, 0], apart[:, 1]) > limits.position_m
        off |= np.abs(se2.wrap_angle(apart[:, 2])) > limits.yaw_rad
    return in_stretches(t_ns, off, ns(limits.lost_s), ns(limits.bridge_s))


def within(judged: Judgement, t_ns: NDArray[np.int64], what: str) -> Flags:
    """(N,) moments inside intervals whose property `what` (is_lost, is_changed) is true."""
    flags = np.zeros(len(t_ns), dtype=bool)
    for interval in judged.intervals:
        if getattr(interval, what):
            flags |= (t_ns >= interval.start_ns) & (t_ns < interval.end_ns)
    return flags
