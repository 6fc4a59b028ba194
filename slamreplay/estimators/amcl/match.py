"""Where scans alone fit best near a pose, and how well they say so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid

#: Steps of the climb at most, and when it is over, in cells and rad: far below any map's truth.
_STEPS, _SMALL_CELLS, _SMALL_RAD = 15, 0.01, 1e-4
#: A scan that leaves a direction open (a corridor) says this much of it: 1 m, 0.5 rad.
_NEARLY_NOTHING = np.diag([1.0, 1.0, 1.0 / 0.5**2])
#: Least mean square distance, in square cells: a cell has that by itself.
_LEAST = 1.0 / 12.0
#: Where a climb puts the elements of the information matrix.
_FULL = 5 + np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


@dataclass(frozen=True, eq=False)
class Matches:
    """S scans against the map.

    Attributes:
        xyyaw: (S, 3) base in the map where each fits best; NaN without beams or a place to begin.
        cov: (S, 3, 3) of that, in the map's axes; an open direction has 1 m or 0.5 rad.
        score: (S,) mean over beams of exp(-d^2 / (2 sigma_hit^2)), d the distance of its end to a
            wall: 1 where all end on walls, about 0 where none does.
    """

    xyyaw: se2.Array
    cov: se2.Array
    score: se2.Array


class ScanMatcher:
    """Climbs from a pose to where the beams' ends lie nearest to walls.

    Gauss-Newton with damping on the likelihood field's Gaussian part, sum of exp(-d^2 / (2
    sigma_hit^2)), whose weights let go of beams that no wall explains (Welsch's function: Holland
    and Welsch 1977, Comm. in Statistics A6, 813-827). The field is interpolated between cells.

    Args:
        config: the filter's.
        grid: the map.
        distance_m: (H, W) from each of its cells to the nearest wall.
    """

    def __init__(
        self, config: AmclConfig, grid: OccupancyGrid, distance_m: NDArray[np.float32]
    ) -> None:
        origin = np.asarray(grid.origin_xyyaw, dtype=np.float64)
        self._frame = np.array([*origin, grid.resolution_m])
        self._turn = _turn(origin[2])
        per = np.array([grid.resolution_m, grid.resolution_m, 1.0])
        self._unit = np.outer(per, per)
        self._sigma = config.sigma_hit / grid.resolution_m
        cut = config.laser_likelihood_max_dist
        self._cells = (np.pad(distance_m, 2, constant_values=cut) / grid.resolution_m).astype(
            np.float32
        )

    def __call__(self, near_xyyaw: se2.Array, ends: Sequence[se2.Array]) -> Matches:
        """Best fits near poses (S, 3) in the map, of scans whose beams end at (2, M), base, m."""
        n = len(ends)
        first = np.cumsum([0, *(e.shape[1] for e in ends)])
        out = np.full((n, 14), np.nan)
        everything = np.concatenate([np.empty((2, 0)), *ends], axis=1)
        climb_all(self._cells, self._frame, near_xyyaw, everything, first, self._sigma, out)
        information = out[:, _FULL] / (self._unit * np.maximum(out[:, 4], _LEAST)[:, None, None])
        known = np.isfinite(out).all(axis=1)
        L = np.linalg.cholesky(information[known] + _NEARLY_NOTHING)
        turned = np.linalg.solve(L, np.broadcast_to(self._turn, L.shape))
        cov = np.full((n, 3, 3), np.nan)
        cov[known] = np.swapaxes(turned, 1, 2) @ turned
        return Matches(out[:, :3], cov, out[:, 3])


def _turn(yaw: float) -> se2.Array:
    """(3, 3) that brings x and y of the map's axes into the grid's."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


@njit(cache=True, error_model="numpy")
def climb_all(distance, frame, near, ends, first, sigma, out):  # type: ignore[no-untyped-def]
    """Fill (S, 14): best pose, its score, mean square distance, and what `_linear` gives there.

    Args: distance (H + 4, W + 4) float32 with a border of two cells, in cells; frame (4,): the
    grid's pose in the map and its resolution in m; near (S, 3) in the map, m; ends (2, sum of M) in
    the base frame, m, those of a scan from `first` (S + 1,) on; sigma in cells. A scan without
    beams, or with a pose that is not finite, is left as it is.
    """
    for k in range(len(out)):
        if first[k] < first[k + 1] and np.isfinite(near[k, 0] + near[k, 1] + near[k, 2]):
            _climb(distance, frame, near[k], ends[:, first[k] : first[k + 1]], sigma, out[k])


@njit(cache=True, error_model="numpy")
def _climb(distance, frame, near, ends, sigma, out):  # type: ignore[no-untyped-def]
    here, there = np.empty(9), np.empty(9)
    cos, sin, size = np.cos(frame[2]), np.sin(frame[2]), frame[3]
    dx, dy = near[0] - frame[0], near[1] - frame[1]
    x, y = (cos * dx + sin * dy) / size, (cos * dy - sin * dx) / size
    yaw = near[2] - frame[2]
    score, square = _linear(distance, size, x, y, yaw, ends, sigma, here)
    damping = 1e-3
    for _ in range(_STEPS):
        dx, dy, dyaw = _step(here, damping)
        higher, around = _linear(distance, size, x - dx, y - dy, yaw - dyaw, ends, sigma, there)
        if higher > score:
            x, y, yaw, score, square = x - dx, y - dy, yaw - dyaw, higher, around
            here, there = there, here
            damping *= 0.1
        else:
            damping *= 10.0
        if max(abs(dx), abs(dy)) < _SMALL_CELLS and abs(dyaw) < _SMALL_RAD:
            break
    out[0] = frame[0] + (cos * x - sin * y) * size
    out[1] = frame[1] + (sin * x + cos * y) * size
    out[2] = (yaw + frame[2] + np.pi) % (2.0 * np.pi) - np.pi
    out[3], out[4] = score, square
    for k in range(9):
        out[5 + k] = here[k]


@njit(cache=True, error_model="numpy")
def _linear(distance, size, x0, y0, yaw, ends, sigma, out):  # type: ignore[no-untyped-def]
    """Score and weighted mean square distance at a pose, all in cells and rad but the ends.

    Fills (9,): the normal equations there, upper triangle by rows and right side.
    """
    height, width = distance.shape
    cos, sin = np.cos(yaw) / size, np.sin(yaw) / size
    total, square = 0.0, 0.0
    xx, xy, xt, yy, yt, tt, gx, gy, gt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(ends.shape[1]):
        dx = cos * ends[0, j] - sin * ends[1, j]
        dy = sin * ends[0, j] + cos * ends[1, j]
        x, y = x0 + dx + 1.5, y0 + dy + 1.5  # border of 2, and distances are of centres
        if not (0.0 <= x < width - 1 and 0.0 <= y < height - 1):
            continue
        col, row = int(x), int(y)
        u, v = x - col, y - row
        a, b = distance[row, col], distance[row, col + 1]
        c, d = distance[row + 1, col], distance[row + 1, col + 1]
        low, high = a + u * (b - a), c + u * (d - c)
        far = low + v * (high - low)
        w = np.exp(-0.5 * (far / sigma) ** 2)
        by_x, by_y = (1.0 - v) * (b - a) + v * (d - c), high - low
        by_yaw = by_y * dx - by_x * dy
        total += w
        square += w * far * far
        xx += w * by_x * by_x
        xy += w * by_x * by_y
        xt += w * by_x * by_yaw
        yy += w * by_y * by_y
        yt += w * by_y * by_yaw
        tt += w * by_yaw * by_yaw
        gx += w * far * by_x
        gy += w * far * by_y
        gt += w * far * by_yaw
    out[0], out[1], out[2], out[3], out[4], out[5] = xx, xy, xt, yy, yt, tt
    out[6], out[7], out[8] = gx, gy, gt
    return total / ends.shape[1], square / max(total, 1e-9)


@njit(cache=True, error_model="numpy")
def _step(equations, damping):  # type: ignore[no-untyped-def]
    """Solution of damped normal equations (9,), by Cholesky."""
    more, least = 1.0 + damping, 1e-9
    p = np.sqrt(equations[0] * more + least)
    q, r = equations[1] / p, equations[2] / p
    s = np.sqrt(max(equations[3] * more + least - q * q, least))
    t = (equations[4] - q * r) / s
    u = np.sqrt(max(equations[5] * more + least - r * r - t * t, least))
    x = equations[6] / p
    y = (equations[7] - q * x) / s
    z = (equations[8] - r * x - t * y) / u
    z = z / u
    y = (y - t * z) / s
    return (x - q * y - r * z) / p, y, z
