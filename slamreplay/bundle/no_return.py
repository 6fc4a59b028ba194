"""Beams without a return that a driver tells as a range: exactly range_max, of all ranges.

REP-117 asks for +inf; simulators and older drivers write range_max. Taken for returns they would
be a wall on a circle that travels with the robot.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Ranges this near to range_max are the code, m: float32 leaves less of it.
_CODE_M = 1e-3
#: It is a code where so many times more ranges lie on it than the half metre before it would bring,
#: and at least so many.
_NEAR_M, _TIMES, _LEAST = 0.5, 20.0, 20


def told_as_range_max(
    ranges_m: NDArray[np.floating], range_max_m: NDArray[np.floating]
) -> NDArray[np.bool_]:
    """(...) which ranges mean that nothing came back; none where range_max is only a range.

    Args:
        ranges_m: (...) of one laser, all its scans.
        range_max_m: (...) of each range, or what broadcasts to it.
    """
    found = np.zeros(ranges_m.shape, dtype=bool)
    near, at, before = _tally(ranges_m, range_max_m)
    if is_code(int(np.count_nonzero(at)), before):
        found.ravel()[near[at]] = True
    return found


def tally(ranges_m: NDArray[np.floating], range_max_m: NDArray[np.floating]) -> tuple[int, int]:
    """Ranges on range_max, and in the half metre before it: summed up they decide `is_code`.

    Args:
        ranges_m: (...) of some scans of one laser.
        range_max_m: (...) of each range, or what broadcasts to it.
    """
    _, at, before = _tally(ranges_m, range_max_m)
    return int(np.count_nonzero(at)), before


def is_code(at: int, before: int) -> bool:
    """Whether range_max means that nothing came back, from the tally of all of a laser's scans."""
    return at >= max(_LEAST, _TIMES * before * _CODE_M / _NEAR_M)


def _tally(
    ranges_m: NDArray[np.floating], range_max_m: NDArray[np.floating]
) -> tuple[NDArray[np.int64], NDArray[np.bool_], int]:
    """Flat index (N,) of the ranges near range_max, which of them lie on it, how many before it."""
    limit = (range_max_m - (_NEAR_M + _CODE_M)).astype(ranges_m.dtype)
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero(ranges_m >= limit)  # few, so that the rest is cheap
        far = np.broadcast_to(range_max_m, ranges_m.shape)
        short = far[np.unravel_index(near, far.shape)] - ranges_m.ravel()[near]
        at = np.abs(short) <= _CODE_M
        before = int(np.count_nonzero((short > _CODE_M) & (short <= _NEAR_M)))
    return near, at, before
