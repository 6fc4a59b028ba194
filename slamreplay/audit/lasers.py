"""Whether a laser's numbers fit each other: frozen ranges, limits, times that do not fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.no_return import told_as_range_max
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: Fewer beams may well be equal.
_FEWEST_BEAMS = 20
#: A robot that moved by so much between two scans cannot see the same to the last bit.
_MOVED_M, _MOVED_RAD = 0.01, 0.01


@dataclass(frozen=True)
class LaserNumbers:
    """What the scans of one topic say of themselves.

    Attributes:
        scans: how many there are.
        blank: scans in which no beam says anything.
        equal: scans of which all beams tell one and the same range.
        frozen: scans that repeat the one before to the last bit although the robot moved.
        no_limits: scans whose range_max is not beyond their range_min.
        period_s: median time between scans, scan_time_s: what they say it is (0: nothing).
        sweep_s: time from the first beam to the last, as time_increment has it; negative where
            it runs backwards.
    """

    scans: int
    blank: int
    equal: int
    frozen: int
    no_limits: int
    period_s: float | None
    scan_time_s: float
    sweep_s: float


def laser_numbers(rows: Table, odometry: PoseTrack | None) -> LaserNumbers:
    """The numbers of one topic's scans.

    Args:
        rows: its rows of table scans.
        odometry: how the robot moved; without it no scan is called frozen.
    """
    if (np.diff(rows.t_ns) < 0).any():
        rows = rows.sorted_by_time()
    ranges, t = rows["ranges_m"], np.unique(rows.t_ns)
    valid, same, hits = _beams(rows)
    again = _repeats(ranges) & (hits >= _FEWEST_BEAMS)  # free space and blanks are all alike
    sweep = rows["time_increment_s"] * np.maximum(ranges.lengths - 1, 0)
    return LaserNumbers(
        scans=len(rows),
        blank=int(np.count_nonzero(~valid)),
        equal=int(np.count_nonzero(same)),
        frozen=int(np.count_nonzero(again & _moved(rows, odometry))),
        no_limits=int(np.count_nonzero(~(rows["range_max_m"] > rows["range_min_m"]))),
        period_s=float(np.median(np.diff(t))) / NS_PER_S if len(t) > 1 else None,
        scan_time_s=_typical(rows["scan_time_s"]),
        sweep_s=_typical(sweep),
    )


def _typical(seconds: se2.Array) -> float:
    """The median of the finite ones, 0 without any."""
    finite = seconds[np.isfinite(seconds)]
    return float(np.median(finite)) if len(finite) else 0.0


def _beams(rows: Table) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.int64]]:
    """Scans (N,) with any beam that says something, of which all say the same; returns in each."""
    ranges = rows["ranges_m"]
    values, lengths, n = ranges.values, ranges.lengths, len(rows)
    near, far = (_each(rows[name], lengths) for name in ("range_min_m", "range_max_m"))
    with np.errstate(invalid="ignore"):
        hit = np.isfinite(values) & (values > 0.0) & (values >= near) & (values <= far)
    free = np.isposinf(values) | told_as_range_max(values, far)
    hit &= ~free
    filled = np.flatnonzero(lengths > 0)
    starts = ranges.offsets[:-1][filled]
    says, same = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    hits = np.zeros(n, dtype=np.int64)
    if not len(filled):
        return says, same, hits
    says[filled] = np.logical_or.reduceat(hit | free, starts)
    low = np.minimum.reduceat(np.where(hit, values, np.inf), starts)
    high = np.maximum.reduceat(np.where(hit, values, -np.inf), starts)
    hits[filled] = count = np.add.reduceat(hit.astype(np.int64), starts)
    same[filled] = (low == high) & (count >= _FEWEST_BEAMS) & (count >= lengths[filled] // 2)
    return says, same, hits


def _each(limit: se2.Array, lengths: NDArray[np.int64]) -> NDArray[np.float32]:
    """A limit of every beam, or the one that all scans have: most lasers never change theirs."""
    narrow = np.asarray(limit, dtype=np.float32)
    same = bool((narrow == narrow[:1]).all())
    return narrow[:1] if same else np.asarray(np.repeat(narrow, lengths))


def _repeats(ranges: Ragged) -> NDArray[np.bool_]:
    """(N,) rows with the very bits of the row before."""
    n, lengths = len(ranges), ranges.lengths
    out = np.zeros(n, dtype=bool)
    bits = np.ascontiguousarray(ranges.values, dtype=np.float32).view(np.uint32)
    alike = np.flatnonzero((lengths[1:] == lengths[:-1]) & (lengths[1:] >= _FEWEST_BEAMS)) + 1
    if n > 1 and (lengths == lengths[0]).all() and lengths[0]:
        rows = bits.reshape(n, -1)
        first = np.flatnonzero(rows[1:, 0] == rows[:-1, 0]) + 1  # nearly all differ in one beam
        out[first] = (rows[first] == rows[first - 1]).all(axis=1)
        return out & (lengths >= _FEWEST_BEAMS)
    for row in alike.tolist():
        a, b, c = (int(k) for k in ranges.offsets[row - 1 : row + 2])
        out[row] = bits[a] == bits[b] and bool((bits[a:b] == bits[b:c]).all())
    return out


def _moved(rows: Table, odometry: PoseTrack | None) -> NDArray[np.bool_]:
    """(N,) scans since whose predecessor the robot moved."""
    moved = np.zeros(len(rows), dtype=bool)
    if odometry is None or len(rows) < 2:
        return moved
    poses = odometry.at(rows.t_ns).xyyaw
    step = se2.between(poses[:-1], poses[1:])
    with np.errstate(invalid="ignore"):
        moved[1:] = (np.hypot(step[:, 0], step[:, 1]) > _MOVED_M) | (
            np.abs(step[:, 2]) > _MOVED_RAD
        )
    return moved
