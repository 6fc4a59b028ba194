"""Whether transforms were there when scans needed them: outside, over a gap, or not yet arrived."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.audit.rates import GAP_PERIODS, GAP_S
from slamreplay.audit.streams import Stream
from slamreplay.geometry.times import NS_PER_S, Times

#: tf2 keeps transforms for so long.
HORIZON_NS = 10 * NS_PER_S


@dataclass(frozen=True)
class Cover:
    """How the moving transforms between odometry and a laser carry its scans.

    A lookup at the scan's stamp needs a transform before it and one after it; on the robot the
    latter must have arrived too.

    Attributes:
        scans: how many there are.
        early: scans stamped before the first transform; late: after the last one.
        outside_s: how far at the most.
        bridged: scans between two transforms that are a gap apart; bridged_s: the widest.
        waiting: scans that had arrived before the transform they needed; typically by
            `wait_median_s`, at the most by `wait_most_s`.
        long_waits: those that waited for longer than `LONG_S`.
        forgotten: scans that came when tf2 had forgotten their transform already.
        worst_ns: stamp of the scan that waited longest.
    """

    scans: int
    early: int
    late: int
    outside_s: float
    bridged: int
    bridged_s: float
    waiting: int
    wait_median_s: float
    wait_most_s: float
    long_waits: int
    forgotten: int
    worst_ns: int | None


#: Costmaps and filters give up on a transform after about this: Nav2's default tolerances.
LONG_S = 0.2


def cover(scans: Stream, edges: list[Stream]) -> Cover | None:
    """How moving edges carry the scans of one laser; None where nothing moves between.

    Args:
        scans: the laser's.
        edges: the moving edges on the way from the odometry frame to the laser's.
    """
    edges = [edge for edge in edges if len(edge)]
    if not edges or not len(scans):
        return None
    t, n = scans.t_ns, len(scans)
    early, late, bridged = (np.zeros(n, dtype=bool) for _ in range(3))
    wide, off = np.zeros(n), np.zeros(n)
    wait = np.full(n, -np.inf)
    forgotten = np.zeros(n, dtype=bool)
    for edge in edges:
        order = np.argsort(edge.t_ns, kind="stable")
        stamps, arrived = edge.t_ns[order], edge.t_log_ns[order]
        before, after = t < stamps[0], t > stamps[-1]
        early, late = early | before, late | after
        off = np.maximum(off, np.where(before, stamps[0] - t, np.where(after, t - stamps[-1], 0)))
        gap, limit = _gap(stamps, t)
        bridged |= gap > limit
        wide = np.maximum(wide, np.where(gap > limit, gap, 0.0))
        # The one after the scan, or any later one, whichever arrived first.
        first = np.minimum.accumulate(arrived[::-1])[::-1]
        needed = np.searchsorted(stamps, t, side="left")
        known = needed < len(stamps)
        came = first[np.minimum(needed, len(stamps) - 1)]
        wait = np.maximum(wait, np.where(known, (came - scans.t_log_ns) / NS_PER_S, -np.inf))
        newest = _newest(edge, scans.t_log_ns)
        forgotten |= newest - t > HORIZON_NS
    waited = wait > 0.0
    return Cover(
        scans=n,
        early=int(early.sum()),
        late=int(late.sum()),
        outside_s=float(off.max()) / NS_PER_S,
        bridged=int(bridged.sum()),
        bridged_s=float(wide.max()) / NS_PER_S,
        waiting=int(waited.sum()),
        wait_median_s=float(np.median(wait[waited])) if waited.any() else 0.0,
        wait_most_s=float(max(wait.max(), 0.0)),
        long_waits=int((wait > LONG_S).sum()),
        forgotten=int(forgotten.sum()),
        worst_ns=int(t[np.argmax(wait)]) if waited.any() else None,
    )


def _gap(stamps: Times, t: Times) -> tuple[NDArray[np.int64], float]:
    """(N,) ns between the two transforms around each time, and what is a gap at their rate."""
    step = np.diff(stamps)
    step = step[step > 0]
    period = float(np.median(step)) if len(step) else 0.0
    high = np.clip(np.searchsorted(stamps, t, side="left"), 1, max(len(stamps) - 1, 1))
    above, below = stamps[np.minimum(high, len(stamps) - 1)], stamps[high - 1]
    inside = (t > below) & (t < above)  # at a sample there is nothing to bridge
    wide = above - below
    return np.where(inside, wide, 0), max(GAP_PERIODS * period, GAP_S * NS_PER_S)


def _newest(edge: Stream, at_log_ns: Times) -> NDArray[np.int64]:
    """(N,) the latest stamp that had arrived at each log time; far in the past where none had."""
    latest = np.maximum.accumulate(edge.t_ns)
    row = np.searchsorted(edge.t_log_ns, at_log_ns, side="right") - 1
    return np.where(row >= 0, latest[np.maximum(row, 0)], np.iinfo(np.int64).min // 2)
