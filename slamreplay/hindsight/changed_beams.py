"""What each beam says of the map, when cast from where the robot really was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, INVALID, Beams
from slamreplay.matching.field import WorkingMap
from slamreplay.matching.threads import share_out

#: What a beam says: nothing, that its wall is there, that something is before it, that it is gone.
SILENT, MET, NEARER, BEYOND = 0, 1, 2, 3
#: A beam has changed, and structure is elsewhere, beyond this distance.
BEYOND_M = 0.25
_WALL, _UNKNOWN = 1, 2
#: So many scans are worth a thread of their own.
_WORTH_A_THREAD = 100


@dataclass(frozen=True, eq=False)
class BeamsOnMap:
    """Beams against the map alone; which of them are changes takes more than one beam to say.

    Attributes:
        says: (N, B) int8 SILENT, MET, NEARER or BEYOND. Beams that meet unmapped cells first are
            silent.
        where: (N, B) int32 flat index of the working map's cell: the wall that was met or passed,
            or the end of a beam that was nearer; -1 of a silent one.
        is_sure: (N, B) BEYOND, and its neighbours to both sides should have been stopped as well:
            along a wall and at its corners a small error of the pose moves the end by metres.
        wall_m: (N, B) float32 distance to the wall that the map expects, NaN without one in reach.
    """

    says: NDArray[np.int8]
    where: NDArray[np.int32]
    is_sure: NDArray[np.bool_]
    wall_m: NDArray[np.float32]


def on_map(working: WorkingMap, beams: Beams, poses: se2.Array) -> BeamsOnMap:
    """Every beam laid over the map.

    Args:
        working: the map.
        beams: the scans.
        poses: (N, 3) of the base in the grid's frame; NaN rows stay silent.
    """
    cells = _WALL * working.walls.astype(np.uint8) | _UNKNOWN * working.unknown.astype(np.uint8)
    says = np.full(beams.kind.shape, SILENT, dtype=np.int8)
    where = np.full(beams.kind.shape, -1, dtype=np.int32)
    is_sure = np.zeros(beams.kind.shape, dtype=bool)
    wall_m = np.full(beams.kind.shape, np.nan, dtype=np.float32)
    poses = np.ascontiguousarray(poses)
    out = (says, where, is_sure, wall_m)

    def work(first: int, stop: int) -> None:
        _lay_over(
            cells,
            working.resolution_m,
            working.corner_xy,
            beams.ends[first:stop],
            beams.kind[first:stop],
            beams.laser_xy,
            poses[first:stop],
            BEYOND_M / working.resolution_m,
            tuple(values[first:stop] for values in out),
        )

    share_out(len(poses), work, _WORTH_A_THREAD)
    return BeamsOnMap(says, where, is_sure, wall_m)


def ends_in(
    mask: NDArray[np.bool_], working: WorkingMap, beams: Beams, poses: se2.Array
) -> NDArray[np.bool_]:
    """(N, B) hits that end in cells of a mask (H, W) of a working map, from poses (N, 3)."""
    out = np.zeros(beams.kind.shape, dtype=bool)
    corner, cell_m = working.corner_xy, working.resolution_m
    _ends_in(mask, corner, cell_m, beams.ends, beams.kind, np.ascontiguousarray(poses), out)
    return out


@njit(cache=True)
def _ends_in(mask, corner, cell_m, ends, kind, poses, out):  # type: ignore[no-untyped-def]
    for s in range(kind.shape[0]):
        if not np.isfinite(poses[s, 0]):
            continue
        cos, sin = np.cos(poses[s, 2]), np.sin(poses[s, 2])
        for b in range(kind.shape[1]):
            if kind[s, b] != HIT:
                continue
            x = poses[s, 0] + cos * ends[s, b, 0] - sin * ends[s, b, 1]
            y = poses[s, 1] + sin * ends[s, b, 0] + cos * ends[s, b, 1]
            col = int(np.floor((x - corner[0]) / cell_m))
            row = int(np.floor((y - corner[1]) / cell_m))
            if 0 <= row < mask.shape[0] and 0 <= col < mask.shape[1]:
                out[s, b] = mask[row, col]


@njit(cache=True, nogil=True)
def _lay_over(  # type: ignore[no-untyped-def]  # noqa: C901
    cells, cell, corner, ends, kind, laser, poses, beyond, out
):
    says, where, is_sure, wall_m = out
    height, width = cells.shape
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
            wall = _to_wall(cells, ox, oy, dx, dy, length + beyond, beyond)
            if wall < 0.0:
                continue
            if wall < np.inf:
                wall_m[s, b] = wall * cell
            is_nearer = wall > length + beyond
            reach = length if is_nearer else wall + 1e-6
            col, row = int(np.floor(ox + dx * reach)), int(np.floor(oy + dy * reach))
            if not (0 <= row < height and 0 <= col < width):
                continue
            if is_nearer or abs(length - wall) <= beyond:
                if kind[s, b] == HIT:
                    says[s, b] = NEARER if is_nearer else MET
                    where[s, b] = row * width + col
                continue
            says[s, b], where[s, b] = BEYOND, row * width + col
            angle = 0.01 + 0.08 / (wall * cell + 0.1)
            ca, sa = np.cos(angle), np.sin(angle)
            # A wall met at more than 70 degrees from its normal sends too little back for "no
            # return" to mean that it is gone.
            slant = 2.75 * angle * wall if kind[s, b] != HIT else np.inf
            is_sure[s, b] = True
            for tilt in (sa, -sa):
                side = _to_wall(
                    cells, ox, oy, ca * dx - tilt * dy, tilt * dx + ca * dy, length, beyond
                )
                if not (0.0 <= side < length - beyond) or abs(side - wall) > slant + 1.0:
                    is_sure[s, b] = False


@njit(cache=True, nogil=True)
def _to_wall(cells, x, y, dx, dy, limit, seam):  # type: ignore[no-untyped-def]
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
        if inside and cells[row, col] & _WALL:
            return travelled if travelled - unmapped <= seam or unmapped == np.inf else -1.0
        if unmapped == np.inf and (not inside or cells[row, col] & _UNKNOWN):
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
