"""Where a scan alone fits best near a pose, and how well it says so."""

from __future__ import annotations

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
_OPEN = np.array([1.0, 1.0, 0.5])
#: Where `climb` puts the elements of the information matrix.
_FULL = 5 + np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


@dataclass(frozen=True, eq=False)
class Match:
    """A scan against the map.

    Attributes:
        xyyaw: (3,) base in the map where it fits best; NaN without beams or a place to begin at.
        cov: (3, 3) of that, in the map's axes; an open direction has 1 m or 0.5 rad.
        score: mean over beams of exp(-d^2 / (2 sigma_hit^2)), d the distance of its end to a wall:
            1 where all end on walls, about 0 where none does.
    """

    xyyaw: se2.Array
    cov: se2.Array
    score: float


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
        self._grid = grid
        self._sigma = config.sigma_hit / grid.resolution_m
        cut = config.laser_likelihood_max_dist
        self._cells = (np.pad(distance_m, 2, constant_values=cut) / grid.resolution_m).astype(
            np.float32
        )

    def __call__(self, near_xyyaw: se2.Array, ends: se2.Array) -> Match:
        """The best fit near a pose (3,) in the map, of beams that end at (2, M), base frame, m."""
        if not ends.shape[1] or not np.isfinite(near_xyyaw).all():
            return Match(np.full(3, np.nan), np.full((3, 3), np.nan), float("nan"))
        size = self._grid.resolution_m
        origin = np.asarray(self._grid.origin_xyyaw, dtype=np.float64)
        start = se2.between(origin, near_xyyaw)
        out = np.empty(14)
        climb(
            self._cells,
            np.array([start[0] / size, start[1] / size, start[2]]),
            ends / size,
            self._sigma,
            out,
        )
        best = se2.compose(origin, np.array([out[0] * size, out[1] * size, out[2]]))
        per = np.array([size, size, 1.0])
        information = out[_FULL] / np.outer(per, per) / max(out[4], 1.0 / 12.0)
        L = np.linalg.cholesky(information + np.diag(1.0 / _OPEN**2))
        turned = np.linalg.solve(L, _turn(origin[2]))
        return Match(best, turned.T @ turned, float(out[3]))


def _turn(yaw: float) -> se2.Array:
    """(3, 3) that brings x and y of the map's axes into the grid's."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


@njit(cache=True, error_model="numpy")
def climb(distance, start, ends, sigma, out):  # type: ignore[no-untyped-def]
    """Fill (14,): best pose, its score, mean square distance, and what `_linear` gives there.

    All in cells and rad. Args: distance (H + 4, W + 4) float32 with a border of two cells, start
    (3,) in the grid's frame, ends (2, M) in the base frame.
    """
    here, there = np.empty(9), np.empty(9)
    x, y, yaw = start[0], start[1], start[2]
    score, square = _linear(distance, x, y, yaw, ends, sigma, here)
    damping = 1e-3
    for _ in range(_STEPS):
        dx, dy, dyaw = _step(here, damping)
        higher, around = _linear(distance, x - dx, y - dy, yaw - dyaw, ends, sigma, there)
        if higher > score:
            x, y, yaw, score, square = x - dx, y - dy, yaw - dyaw, higher, around
            here, there = there, here
            damping *= 0.1
        else:
            damping *= 10.0
        if max(abs(dx), abs(dy)) < _SMALL_CELLS and abs(dyaw) < _SMALL_RAD:
            break
    out[0], out[1], out[2], out[3], out[4] = x, y, yaw, score, square
    for k in range(9):
        out[5 + k] = here[k]


@njit(cache=True, error_model="numpy")
def _linear(distance, x0, y0, yaw, ends, sigma, out):  # type: ignore[no-untyped-def]
    """Score and weighted mean square distance at a pose.

    Fills (9,): the normal equations there, upper triangle by rows and right side.
    """
    height, width = distance.shape
    cos, sin = np.cos(yaw), np.sin(yaw)
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
