"""Two publishers of one transform: its values go back and forth between two tellings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.audit.streams import Stream
from slamreplay.audit.tf_tree import distance
from slamreplay.bundle.tables import Table
from slamreplay.geometry.times import NO_STAMP

#: Tellings differ if they lie farther apart than this (m plus rad at a metre), and than so many of
#: the usual steps.
_APART, _STEPS = 0.02, 4.0
_USUAL = 0.25
#: Having gone there, the next one is back to within this part of the way.
_BACK = 0.5
#: So many, and this share of all, are no single outliers.
_FEWEST, _SHARE = 5, 0.02


@dataclass(frozen=True)
class Disagreement:
    """An edge of which two tellings alternate.

    Attributes:
        edge: parent and child.
        times: how often the value went there and came back.
        apart: how far the two lie apart, typically: m plus rad at one metre.
        same_stamp: pairs of one stamp with different values.
        start_ns: first time on the bundle's clock, end_ns: last one.
        n: samples.
    """

    edge: tuple[str, str]
    times: int
    apart: float
    same_stamp: int
    start_ns: int
    end_ns: int
    n: int


def disagreement(edge: Stream, transforms: Table) -> Disagreement | None:
    """Whether values of an edge alternate, in the order they were recorded."""
    n = len(edge)
    if n < 2 * _FEWEST or edge.edge is None:
        return None
    one = distance(transforms, edge.rows[1:], edge.rows[:-1])
    two = distance(transforms, edge.rows[2:], edge.rows[:-2])
    # Where two alternate, few steps are the usual ones, or only those to the next but one.
    usual = min(float(np.quantile(one, _USUAL)), float(np.quantile(two, _USUAL)))
    far = one > max(_APART, _STEPS * usual)
    back = far[:-1] & far[1:] & (two < _BACK * np.minimum(one[:-1], one[1:]))
    twice = (np.diff(edge.t_sensor_ns) == 0) & (edge.t_sensor_ns[1:] != NO_STAMP) & far
    times = int(np.count_nonzero(back))
    if times < _FEWEST or times < _SHARE * n:
        return None
    at = np.flatnonzero(back) + 1
    apart = float(np.median(one[at]))
    t = edge.t_ns[at]
    return Disagreement(
        edge.edge, times, apart, int(np.count_nonzero(twice)), int(t.min()), int(t.max()), n
    )
