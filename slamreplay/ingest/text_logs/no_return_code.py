"""What a laser wrote where nothing came back, read off the readings themselves.

CARMEN's lines of a laser do not say it, and drivers differ: a SICK LMS that counts centimetres
writes 81.83 m (its overflow code 1FF7h) and more for other faults, others write a round 50 m, or
the laser's exact maximum.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.tables import Ragged

#: CARMEN's own maximum where a line does not say one (global/readlog.c): no laser of that time
#: measured farther.
MAX_M = 80.0
#: A code is told at least so often, so many times more often than a range before it, and by so
#: large a part of the beams: what a standing robot sees far off is told by few of them.
_LEAST, _TIMES, _BEAMS = 20, 20.0, 0.1
#: Ranges before the code it is compared with, codes of other faults above it, m.
_BEFORE_M, _ABOVE_M = 0.5, 0.1
#: Ranges beyond the code, per code: spikes of the driver.
_BEYOND = 0.01


def no_return_code(ranges_m: Ragged, limit_m: float) -> float | None:
    """The range in m that stands for beams without a return, or None where none does.

    Args:
        ranges_m: all scans of one laser.
        limit_m: what the laser cannot measure beyond.
    """
    values = ranges_m.values.astype(np.float64)
    usable = np.isfinite(values) & (values > 0.0) & (values < 1e6)
    millimetres = np.where(usable, np.rint(values * 1000.0), 0.0).astype(np.int64)
    told, counts = np.unique(millimetres[usable], return_counts=True)
    far = 1e-3 * told
    is_beyond = far >= limit_m - 1e-3
    from_here = np.append(np.cumsum(counts[::-1])[::-1], 0)
    first_beyond = int(np.count_nonzero(~is_beyond))
    for i in np.flatnonzero(~is_beyond & (counts >= _LEAST)).tolist():
        above = int(np.searchsorted(far, far[i] + _ABOVE_M, side="right"))
        longer = from_here[min(above, first_beyond)] - from_here[first_beyond]
        if longer > _BEYOND * counts[i]:
            continue
        before = counts[np.searchsorted(far, far[i] - _BEFORE_M) : i]
        often = not len(before) or counts[i] >= _TIMES * before.mean()
        if often and _share_of_beams(ranges_m, millimetres == told[i]) >= _BEAMS:
            return float(far[i])
    codes = far[is_beyond & (counts >= _LEAST)]
    return float(codes[0]) if len(codes) else None


def _share_of_beams(ranges_m: Ragged, told: np.ndarray) -> float:
    """Share of a scan's beams that told it at least once."""
    beam = np.arange(len(told)) - np.repeat(ranges_m.offsets[:-1], ranges_m.lengths)
    return len(np.unique(beam[told])) / int(ranges_m.lengths.max(initial=1))
