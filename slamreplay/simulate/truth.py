"""What the truth says of a log, by the definitions that the verdict is judged by.

Lost: the belief is more than 0.5 m or 20 deg from the truth for 3 s or longer. Map changed: more
than 8 % of the valid beams are changed beams for 2 s or longer. The log is lost, changed or both
where the total time of each is 5 s or more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays

_FAR_M, _FAR_RAD, LOST_FOR_S = 0.5, np.radians(20.0), 3.0
_NEAR_M, CHANGED_SHARE, CHANGED_FOR_S = 0.25, 0.08, 2.0
#: Gaps shorter than this end no stretch that is lost or changed.
GAP_S = 1.0
_LOG_FOR_S = 5.0


def is_far(belief_xyyaw: se2.Array, true_xyyaw: se2.Array) -> NDArray[np.bool_]:
    """(N,) where beliefs (N, 3) are further from the truth (N, 3) than a lost robot's need be."""
    off = np.hypot(*(belief_xyyaw - true_xyyaw)[:, :2].T)
    turned = np.abs(se2.wrap_angle(belief_xyyaw[:, 2] - true_xyyaw[:, 2]))
    return (off > _FAR_M) | (turned > _FAR_RAD)


def changed_beams(
    grid: OccupancyGrid,
    standing: OccupancyGrid,
    rays: se2.Array,
    ranges: NDArray,
    range_max_m: float,
) -> NDArray[np.bool_]:
    """(N,) which beams meet a change: something standing that the map lacks, or the reverse.

    Args:
        grid: the map.
        standing: what stands today.
        rays: (N, 3) true origin and direction of each beam in the map frame.
        ranges: (N,) measured, m; +inf for no return, others outside (0, range_max] are no beams.
        range_max_m: the lidar's.
    """
    mapped = cast_rays(grid, rays, np.zeros(1), range_max_m)[:, 0]
    reach = np.minimum(ranges, range_max_m)
    step = grid.resolution_m / 2.0
    end = _along(rays, reach + step)
    wall = _along(rays, np.where(np.isfinite(mapped), mapped, 0.0) + step)
    to_mapped, to_standing = _distance(grid), _distance(standing)
    appeared = (
        np.isfinite(ranges)
        & (ranges < mapped - _NEAR_M)
        & (_look_up(standing, to_standing, end) < 0.1)
        & (_look_up(grid, to_mapped, end) > _NEAR_M)
        & ~_meets_unknown(grid, rays, reach)
    )
    removed = (
        np.isfinite(mapped)
        & (ranges > mapped + _NEAR_M)
        & (_look_up(standing, to_standing, wall) > _NEAR_M)
        & ~_meets_unknown(grid, rays, np.where(np.isfinite(mapped), mapped, 0.0))
    )
    return (ranges > 0.0) & (appeared | removed)


def stretches(
    t: NDArray, holds: NDArray[np.bool_], at_least: float, gap: float
) -> list[tuple[int, int]]:
    """First and last row of each stretch in which something holds.

    Args:
        t: (N,) times in any unit, that of the two limits.
        holds: (N,) flags.
        at_least: shorter stretches are left out.
        gap: shorter gaps are bridged.
    """
    rows = np.flatnonzero(holds)
    parts = np.split(rows, np.flatnonzero(np.diff(t[rows]) >= gap) + 1) if len(rows) else []
    return [(int(p[0]), int(p[-1])) for p in parts if t[p[-1]] - t[p[0]] >= at_least]


def in_stretches(
    t: NDArray, holds: NDArray[np.bool_], at_least: float, gap: float
) -> NDArray[np.bool_]:
    """(N,) rows that lie in one of the `stretches`."""
    out = np.zeros(len(t), dtype=bool)
    for first, last in stretches(t, holds, at_least, gap):
        out[first : last + 1] = True
    return out


def verdict(
    t_s: se2.Array, far: NDArray[np.bool_], scan_t_s: se2.Array, changed_share: se2.Array
) -> str:
    """The state of a log, from when the belief was far off and each scan's changed share."""
    lost = total_s(t_s, far, LOST_FOR_S) >= _LOG_FOR_S
    changed = total_s(scan_t_s, changed_share > CHANGED_SHARE, CHANGED_FOR_S) >= _LOG_FOR_S
    if lost and changed:
        return "lost_and_map_changed"
    return "lost" if lost else "map_changed" if changed else "healthy"


def total_s(t_s: se2.Array, holds: NDArray[np.bool_], at_least_s: float) -> float:
    """Seconds for which something holds in all, `GAP_S` bridged, shorter stretches left out."""
    return sum(float(t_s[b] - t_s[a]) for a, b in stretches(t_s, holds, at_least_s, GAP_S))


def _along(rays: se2.Array, distance: se2.Array) -> se2.Array:
    direction = np.column_stack([np.cos(rays[:, 2]), np.sin(rays[:, 2])])
    return rays[:, :2] + distance[:, None] * direction


def _distance(grid: OccupancyGrid) -> NDArray:
    return distance_transform_edt(~grid.occupied, sampling=grid.resolution_m)


def _look_up(grid: OccupancyGrid, values: NDArray, points: se2.Array) -> NDArray:
    cells = grid.cell_of(points)
    inside = grid.inside(cells)
    cells = np.where(inside[:, None], cells, 0)
    return np.where(inside, values[cells[:, 0], cells[:, 1]], np.inf)


def _meets_unknown(grid: OccupancyGrid, rays: se2.Array, reach: se2.Array) -> NDArray[np.bool_]:
    """Which beams pass an unknown cell before they end: nothing can be said of those."""
    unknown = OccupancyGrid(
        np.where(grid.cells < 0, 100, 0).astype(np.int8), grid.resolution_m, grid.origin_xyyaw
    )
    first = cast_rays(unknown, rays, np.zeros(1), float(np.max(reach, initial=0.0)))[:, 0]
    return first < reach - grid.resolution_m
