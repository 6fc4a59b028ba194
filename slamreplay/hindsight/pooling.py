"""Shares of beams, pooled over two lasers: the map is contradicted by all that the robot sees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.beams import INVALID, Beams


def pooled(both: Beams, is_first: NDArray[np.bool_], share: se2.Array) -> se2.Array:
    """Share of the valid beams of each scan of the first laser and the second's beside it.

    A scan of the second laser counts with the first's scan next after it, the last ones with the
    last. Scans without a share, as those without a pose, count for nothing.

    Args:
        both: M scans of both lasers in time order.
        is_first: (M,) which are the first laser's, N of them.
        share: (M,) of the valid beams of each scan, NaN where there is none.

    Returns:
        (N,) shares, NaN where neither scan has one.
    """
    n = int(is_first.sum())
    beside = np.minimum(np.cumsum(is_first) - is_first, n - 1)
    valid = np.count_nonzero(both.kind != INVALID, axis=1) * np.isfinite(share)
    among = np.bincount(beside, valid, n)
    those = np.bincount(beside, valid * np.nan_to_num(share), n)
    return np.where(among > 0, those / np.maximum(among, 1), np.nan)
