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
    limit = (range_max_m - (_NEAR_M + _CODE_M)).astype(ranges_m.dtype)
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero(ranges_m >= limit)  # few, so that the rest is cheap
        far = np.broadcast_to(range_max_m, ranges_m.shape)
        short = far[np.unravel_index(near, far.shape)] - ranges_m.ravel()[near]
        at = np.abs(short) <= _CODE_M
        before = np.count_nonzero((short > _CODE_M) & (short <= _NEAR_M))
    if np.count_nonzero(at) >= max(_LEAST, _TIMES * before * _CODE_M / _NEAR_M):
        found.ravel()[near[at]] = True
    return found
