"""The way between two keyframes: odometry from either side, and what it misses in between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2


@dataclass(frozen=True, eq=False)
class Way:
    """Where each of N scans lies between its keyframes.

    Attributes:
        xyyaw: (N, 3) carried by odometry, what it misses spread evenly over the time.
        ahead: (N, 3) carried by odometry from the keyframe before.
        back: (N, 3) carried by odometry from the keyframe after.
        before: (N,) the keyframe before, or the scan's own.
        after: (N,) the keyframe after.
        part: (N,) how much of the time between both has passed, 0 to 1.
        missing: (N, 3) what odometry misses between both.
    """

    xyyaw: se2.Array
    ahead: se2.Array
    back: se2.Array
    before: NDArray[np.int64]
    after: NDArray[np.int64]
    part: se2.Array
    missing: se2.Array


def between_keyframes(
    t_ns: NDArray[np.int64], odometry: se2.Array, keys: NDArray[np.int64], poses: se2.Array
) -> Way:
    """Every scan by odometry from the keyframes on both sides.

    Args:
        t_ns: (N,) times of the scans.
        odometry: (N, 3) odometry at the scans.
        keys: (K,) indices of the keyframes among the scans, ascending, K >= 1.
        poses: (K, 3) their poses.
    """
    scan = np.arange(len(t_ns))
    before = np.clip(np.searchsorted(keys, scan, side="right") - 1, 0, len(keys) - 1)
    after = np.minimum(before + 1, len(keys) - 1)
    after[scan < keys[0]] = 0
    ahead = se2.compose(poses[before], se2.between(odometry[keys[before]], odometry))
    back = se2.compose(poses[after], se2.between(odometry[keys[after]], odometry))
    span = np.maximum(t_ns[keys[after]] - t_ns[keys[before]], 1)
    part = np.clip((t_ns - t_ns[keys[before]]) / span, 0.0, 1.0)
    missing = se2.between(ahead, back)
    carried = se2.compose(ahead, part[:, None] * missing)
    return Way(carried, ahead, back, before, after, part, missing)
