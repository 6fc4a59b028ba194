"""Which beams contradict the map, when cast from where the robot really was."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, INVALID, Beams

UNCHANGED, APPEARED, REMOVED = 0, 1, 2
#: Bits of a cell: mapped wall, not mapped, new structure stands here, something stands near.
WALL, UNKNOWN, NEW, SUPPORTED = 1, 2, 4, 8


def changed_beams(
    cells: NDArray[np.uint8],
    cell_m: float,
    corner_xy: se2.Array,
    beams: Beams,
    poses: se2.Array,
    beyond_m: float,
) -> tuple[NDArray[np.int8], NDArray[np.int32]]:
    """What each beam says of the map.

    A beam is APPEARED where it ends on new structure, farther than `beyond_m` before any mapped
    wall; REMOVED where it goes on beyond the wall that should have stopped it by more than that,
    and nothing stands near the place. Beams that meet unmapped cells first are unchanged, and so
    are those along a wall: there a small error of the pose moves the expected end by metres.

    Args:
        cells: (H, W) bits of each cell.
        cell_m: edge of a cell.
        corner_xy: (2,) corner of cell (0, 0) in the grid's frame, m.
        beams: the scans.
        poses: (N, 3) of the base in the grid's frame; NaN rows are skipped.
        beyond_m: how much is a difference.

    Returns:
        (N, B) UNCHANGED, APPEARED or REMOVED; (N, B) flat index of the cell that changed, or -1.
    """
    change = np.full(beams.kind.shape, UNCHANGED, dtype=np.int8)
    where = np.full(beams.kind.shape, -1, dtype=np.int32)
    poses = np.ascontiguousarray(poses)
    _classify(
        cells,
        cell_m,
        corner_xy,
        beams.ends,
        beams.kind,
        beams.laser_xy,
        poses,
        beyond_m,
        change,
        where,
    )
    return change, where


@njit(cache=True)
def _classify(  # type: ignore[no-untyped-def]  # noqa: C901
    cells, cell, corner, ends, kind, laser, poses, beyond_m, change, where
):
    height, width = cells.shape
    beyond = beyond_m / cell
    for s in range(poses.shape[0]):
        if not np.isfinite(poses[s, 0]):
            continue
        cos, sin = np.cos(poses[s, 2]), np.sin(poses[s, 2])
        px, py = (poses[s, 0] - corner[0]) / cell, (poses[s, 1] - corner[1]) / cell
        ox = px + (cos * laser[0] - sin * laser[1]) / cell
        oy = py + (sin * laser[0] + cos * laser[1]) / cell
        for b in range(ends.shape[1]):
            if kind[s, b] == INVALID:
                continue
            dx = px + (cos * ends[s, b, 0] - sin * ends[s, b, 1]) / cell - ox
            dy = py + (sin * ends[s, b, 0] + cos * ends[s, b, 1]) / cell - oy
            length = np.sqrt(dx * dx + dy * dy)
            if length <= 0.0:
                continue
            dx, dy = dx / length, dy / length
            wall = to_wall(cells, ox, oy, dx, dy, length + beyond, beyond)
            if wall < 0.0:
                continue
            if kind[s, b] == HIT and wall > length + beyond:
                col, row = int(np.floor(ox + dx * length)), int(np.floor(oy + dy * length))
                if 0 <= row < height and 0 <= col < width and cells[row, col] & NEW:
                    change[s, b], where[s, b] = APPEARED, row * width + col
            elif wall + beyond < length:
                col = int(np.floor(ox + dx * (wall + 1e-6)))
                row = int(np.floor(oy + dy * (wall + 1e-6)))
                if not (0 <= row < height and 0 <= col < width) or cells[row, col] & SUPPORTED:
                    continue
                # Only a beam whose neighbours to both sides should have been stopped as well.
                angle = 0.01 + 0.08 / (wall * cell + 0.1)
                ca, sa = np.cos(angle), np.sin(angle)
                # A wall met at more than 70 degrees from its normal sends too little back for
                # "no return" to mean that it is gone.
                slant = 2.75 * angle * wall if kind[s, b] != HIT else np.inf
                stopped = True
                for k in range(2):
                    tilt = sa if k else -sa
                    side = to_wall(
                        cells, ox, oy, ca * dx - tilt * dy, tilt * dx + ca * dy, length, beyond
                    )
                    stopped = stopped and side >= 0.0 and side + beyond < length
                    stopped = stopped and abs(side - wall) <= slant + 1.0
                if stopped:
                    change[s, b], where[s, b] = REMOVED, row * width + col


@njit(cache=True)
def to_wall(cells, x, y, dx, dy, limit, seam):  # type: ignore[no-untyped-def]
    """Distance in cells to the first wall, inf where none is within `limit`, -1 if unmapped first.

    A mapper leaves thin unmapped seams before walls: one thinner than `seam` does not count. Beyond
    the map nothing is mapped.
    """
    height, width = cells.shape
    col, row = int(np.floor(x)), int(np.floor(y))
    step_col, step_row = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    delta_col = np.inf if dx == 0.0 else abs(1.0 / dx)
    delta_row = np.inf if dy == 0.0 else abs(1.0 / dy)
    to_col = np.inf if dx == 0.0 else ((col + 1 - x) if dx > 0 else (x - col)) * delta_col
    to_row = np.inf if dy == 0.0 else ((row + 1 - y) if dy > 0 else (y - row)) * delta_row
    travelled, unmapped = 0.0, np.inf
    while travelled <= limit:
        inside = 0 <= row < height and 0 <= col < width
        if inside and cells[row, col] & WALL:
            return travelled if travelled - unmapped <= seam or unmapped == np.inf else -1.0
        if unmapped == np.inf and (not inside or cells[row, col] & UNKNOWN):
            unmapped = travelled
        if travelled - unmapped > seam:
            return -1.0
        if to_col < to_row:
            travelled = to_col
            to_col += delta_col
            col += step_col
        else:
            travelled = to_row
            to_row += delta_row
            row += step_row
    return np.inf if unmapped > limit - seam else -1.0
