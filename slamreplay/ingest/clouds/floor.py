"""Where the floor lies about the robot, from what its sensor sees of it."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array

#: Floor nearer than this to the sensor is the robot itself; farther off, slopes are not the floor.
_FROM_M, _TO_M = 0.4, 10.0
_BIN_M = 0.02
#: Share of the points at its height or near it that a floor brings together within three bins, and
#: the angles under which it is seen, rad: one ring of a lidar may lie level on a wall.
_SHARE, _SEEN_UNDER = 0.02, 0.05
#: Nothing lies lower than a floor, but for a share of what it shows itself: mirrors in its polish.
_UNDER_M, _UNDER = 0.12, 0.3
#: A mount may be off by so many degrees of what tf says of it, to either side; more is a ramp.
_TILTS_DEG = (0, -1, 1, -2, 2, -3, 3)
#: A tilted floor must gather so many times the points of a level one.
_CLEARLY = 1.3
#: Residuals that still count as floor in the rounds of the fit, m.
_ROUNDS_M = (0.15, 0.08, 0.05, 0.04, 0.04)
_FEWEST, _ENOUGH = 100, 20_000


def floor_plane(points: Array, sensor_xyz: Array, between_m: tuple[float, float]) -> Array | None:
    """(3,) z, dz/dx and dz/dy of the floor in the base frame, or None where none is seen.

    The lowest height at which points gather, for the tilt with which most do; then a plane through
    what lies close to it.

    Args:
        points: (M, 3) in the base frame, finite.
        sensor_xyz: (3,) where the sensor sits.
        between_m: heights in the base frame between which the floor lies at the sensor's place.
    """
    about = points - np.append(sensor_xyz[:2], 0.0)
    away = np.hypot(about[:, 0], about[:, 1])
    about = about[(away >= _FROM_M) & (away <= _TO_M)]
    about = about[:: max(len(about) // _ENOUGH, 1)]
    elevation = np.arctan2(about[:, 2] - sensor_xyz[2], np.hypot(about[:, 0], about[:, 1]))
    best, most = None, 0.0
    for tilt in sorted(product(np.tan(np.radians(_TILTS_DEG)), repeat=2), key=np.linalg.norm):
        z = about[:, 2] - about[:, :2] @ tilt
        asked = (z > between_m[0]) & (z < between_m[1])
        height, count = _lowest_gathering(z[asked], elevation[asked])
        if count > _CLEARLY * most:
            best, most = np.array([height, *tilt]), count
    if best is None:
        return None
    for limit in _ROUNDS_M:
        kept = np.abs(about[:, 2] - best[0] - about[:, :2] @ best[1:]) <= limit
        if kept.sum() < _FEWEST:
            break
        best = _fitted(about[kept])
    return best - np.array([best[1:] @ sensor_xyz[:2], 0.0, 0.0])


def _lowest_gathering(
    z: NDArray[np.float64], elevation: NDArray[np.float64]
) -> tuple[float, float]:
    """The lowest height at which points gather, and how many; 0 where that is no floor."""
    if len(z) < _FEWEST:
        return 0.0, 0.0
    edges = np.arange(z.min() - 2 * _BIN_M, z.max() + 3 * _BIN_M, _BIN_M)
    counts = np.convolve(np.histogram(z, edges)[0], np.ones(3), mode="same")
    tall = np.flatnonzero(counts >= max(_SHARE * len(z), 0.5 * _FEWEST))
    if not len(tall):
        return 0.0, 0.0
    ends = np.flatnonzero(np.diff(tall) > 1)
    first = tall[: ends[0] + 1] if len(ends) else tall
    peak = first[np.argmax(counts[first])]
    height, count = float(edges[peak] + 0.5 * _BIN_M), float(counts[peak])
    low, high = np.quantile(elevation[np.abs(z - height) <= 1.5 * _BIN_M], [0.05, 0.95])
    is_under = np.count_nonzero(z < height - _UNDER_M) > _UNDER * count
    return (0.0, 0.0) if is_under or high - low < _SEEN_UNDER else (height, count)


def _fitted(points: Array) -> Array:
    """The plane through points; level where they lie in too narrow a strip to tell a slope."""
    middle = points.mean(axis=0)
    across = points - middle
    spread = np.linalg.eigvalsh(across[:, :2].T @ across[:, :2] / len(points))
    if spread[0] < 0.3**2:
        return np.array([middle[2], 0.0, 0.0])
    slope = np.linalg.lstsq(across[:, :2], across[:, 2], rcond=None)[0]
    return np.array([middle[2] - slope @ middle[:2], *slope])
