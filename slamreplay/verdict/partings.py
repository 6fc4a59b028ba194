"""Where two motions part: odometry, hindsight and belief laid beside each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: How far back the cause is looked for, and over which stretches motions are compared.
BACK_NS, STRETCH_NS = 30 * NS_PER_S, 3 * NS_PER_S
#: Two motions over such a stretch that differ by more than this disagree.
DISAGREE_M, DISAGREE_RAD = 0.3, np.radians(10.0)


@dataclass(frozen=True)
class Parting:
    """The stretch over which two motions differ most, and when they first began to.

    Attributes:
        start: row at which the worst stretch begins.
        end: row at which it ends.
        start_ns: when the first bad stretch had gathered a quarter of its difference.
        metres: by how much the two differ over the worst stretch.
        radians: the same in heading.
        moved_m: how far the first of the two moved in it.
        other_m: how far the other one did.
        jump_m: the largest single step of the first that the other one did not make.
    """

    start: int
    end: int
    start_ns: int
    metres: float
    radians: float
    moved_m: float
    other_m: float
    jump_m: float


def parting(
    t_ns: NDArray[np.int64],
    one: se2.Array,
    other: se2.Array,
    known: NDArray[np.bool_],
    onset: int,
) -> Parting | None:
    """Where two tracks (N, 3) in different frames differ in their motion, before the onset."""
    sound = known & np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
    sound &= (t_ns >= onset - BACK_NS) & (t_ns <= onset + NS_PER_S)
    rows = np.flatnonzero(sound)
    if len(rows) < 2:
        return None
    t = t_ns[rows]
    # The end of a stretch lies three seconds on, or at the next row where none is known that soon.
    ahead = np.searchsorted(t, t + STRETCH_NS)
    ahead = np.clip(ahead, np.arange(len(t)) + 1, len(t) - 1)
    a, b = one[rows], other[rows]
    step_a, step_b = se2.between(a, a[ahead]), se2.between(b, b[ahead])
    metres = np.hypot(*(step_a - step_b)[:, :2].T)
    radians = np.abs(se2.wrap_angle(step_a[:, 2] - step_b[:, 2]))
    # Over a gap in the scans a stretch is longer, and calibration errors have longer to add up.
    longer = np.maximum((t[ahead] - t) / STRETCH_NS, 1.0)
    bad = (metres > DISAGREE_M * longer) | (radians > DISAGREE_RAD * longer)
    if not bad.any():
        return None
    first = int(np.argmax(bad))
    drift = [se2.between(track[first], track[first : int(ahead[first]) + 1]) for track in (a, b)]
    grown = np.hypot(*(drift[0] - drift[1])[:, :2].T) / DISAGREE_M
    grown = np.maximum(grown, np.abs(se2.wrap_angle((drift[0] - drift[1])[:, 2])) / DISAGREE_RAD)
    begun = int(t[first + int(np.argmax(grown > 0.25 * grown[-1]))])
    worst = int(np.argmax(np.maximum(metres / DISAGREE_M, radians / DISAGREE_RAD) / longer))
    low, high = worst, int(ahead[worst])
    hops = np.hypot(*np.diff(a[low : high + 1, :2], axis=0).T)
    hops_b = np.hypot(*np.diff(b[low : high + 1, :2], axis=0).T)
    return Parting(
        int(rows[low]),
        int(rows[high]),
        begun,
        float(metres[worst]),
        float(radians[worst]),
        float(np.hypot(*step_a[worst, :2])),
        float(np.hypot(*step_b[worst, :2])),
        float((hops - hops_b).max(initial=0.0)),
    )
