"""Posts, arms and loads of the robot itself: what stays where it is however the robot turns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack

#: One look after each turn by so much, for a wall that is driven along keeps its range, and one
#: that is turned before does not. All looks together make at least a whole turn.
_STEP_RAD, _TURN_RAD = 0.1, 2.0 * np.pi
#: A body ends within this reach; a beam meets it at the same range in this share of looks.
_REACH_M, _SAME_M, _SHARE = 1.5, 0.03, 0.8


def without_body(
    ranges_m: NDArray[np.float32], t_ns: NDArray[np.int64], track: PoseTrack | None
) -> NDArray[np.float32]:
    """Ranges (N, B) with NaN where a beam meets the robot's own body.

    Args:
        ranges_m: of one sensor, in time order.
        t_ns: (N,) times of the scans.
        track: the base in a frame that does not jump; without it nothing tells body from wall.
    """
    looks, turned = _looks(np.empty(0) if track is None else track.at(t_ns).xyyaw[:, 2])
    if turned < _TURN_RAD:
        return ranges_m
    near = np.where(ranges_m[looks] <= _REACH_M, ranges_m[looks], np.nan)
    often = np.isfinite(near).mean(axis=0) >= _SHARE
    usual = np.full(near.shape[1], np.nan)
    usual[often] = np.nanmedian(near[:, often], axis=0)
    with np.errstate(invalid="ignore"):
        share = (np.abs(near - usual) <= _SAME_M).mean(axis=0)
        own = (share >= _SHARE) & (np.abs(ranges_m - usual) <= 2.0 * _SAME_M)
    return np.where(own, np.float32(np.nan), ranges_m)


def _looks(yaw: NDArray[np.float64]) -> tuple[NDArray[np.int64], float]:
    """Scans between which the robot has turned (NaN: heading not known), and how far in all."""
    known = np.flatnonzero(np.isfinite(yaw))
    heading = np.unwrap(yaw[known]).tolist()
    looks, turned, last = [], 0.0, None
    for row, here in zip(known.tolist(), heading, strict=True):
        if last is None or abs(here - last) >= _STEP_RAD:
            turned += 0.0 if last is None else abs(here - last)
            looks.append(row)
            last = here
    return np.array(looks, dtype=np.int64), turned
