"""What the beams, replayed from the hindsight poses, say of each cell: stood there, was empty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, INVALID, Beams
from slamreplay.matching.field import WorkingMap

CELL_M = 0.1
#: Two observations of a cell farther apart in time than this do not tell what was in between.
GAP_S = 1.0
#: A pass counts up to this distance before the beam's end: noise puts ends short.
SHORT_M = 0.2


@dataclass(frozen=True, eq=False)
class Evidence:
    """Observed time per evidence cell, which is `step` x `step` cells of the working map.

    Attributes:
        hit_s: (H, W) seconds for which something was seen there.
        pass_s: (H, W) seconds for which beams went through.
        step: working map cells along an edge.
    """

    hit_s: NDArray[np.float32]
    pass_s: NDArray[np.float32]
    step: int


def gather(working: WorkingMap, beams: Beams, poses: se2.Array) -> Evidence:
    """Evidence of all scans with a pose (N, 3) in the grid's frame."""
    step = max(1, round(CELL_M / working.resolution_m))
    height, width = (-(-n // step) for n in working.walls.shape)
    hit_s, pass_s = np.zeros((2, height, width), dtype=np.float32)
    cell = step * working.resolution_m
    _gather(
        hit_s,
        pass_s,
        cell,
        working.corner_xy,
        (beams.t_ns - beams.t_ns[0]) / 1e9,
        beams.ends,
        beams.kind,
        beams.laser_xy,
        poses,
    )
    return Evidence(hit_s, pass_s, step)


@njit(cache=True)
def _gather(  # type: ignore[no-untyped-def]  # noqa: C901
    hit_s, pass_s, cell, corner, t, ends, kind, laser, poses
):
    height, width = hit_s.shape
    last_hit = np.full(hit_s.shape, -1e9)
    last_pass = np.full(hit_s.shape, -1e9)
    for s in range(poses.shape[0]):
        if not np.isfinite(poses[s, 0]):
            continue
        cos, sin, now = np.cos(poses[s, 2]), np.sin(poses[s, 2]), t[s]
        px, py = (poses[s, 0] - corner[0]) / cell, (poses[s, 1] - corner[1]) / cell
        ox = px + (cos * laser[0] - sin * laser[1]) / cell
        oy = py + (sin * laser[0] + cos * laser[1]) / cell
        for hits in (True, False):
            for b in range(ends.shape[1]):
                if kind[s, b] == INVALID or (hits and kind[s, b] != HIT):
                    continue
                ex = px + (cos * ends[s, b, 0] - sin * ends[s, b, 1]) / cell
                ey = py + (sin * ends[s, b, 0] + cos * ends[s, b, 1]) / cell
                if hits:
                    col, row = int(np.floor(ex)), int(np.floor(ey))
                    if 0 <= row < height and 0 <= col < width and last_hit[row, col] < now:
                        gap = now - last_hit[row, col]
                        if gap <= GAP_S:
                            hit_s[row, col] += gap
                        last_hit[row, col] = now
                    continue
                dx, dy = ex - ox, ey - oy
                length = np.sqrt(dx * dx + dy * dy)
                # Half a cell a step may skip a corner that the ray only grazes, and no more.
                for i in range(int(2.0 * (length - SHORT_M / cell))):
                    part = 0.5 * i / length
                    col, row = int(np.floor(ox + part * dx)), int(np.floor(oy + part * dy))
                    if 0 <= row < height and 0 <= col < width:
                        if last_hit[row, col] == now or last_pass[row, col] == now:
                            continue
                        gap = now - last_pass[row, col]
                        if gap <= GAP_S:
                            pass_s[row, col] += gap
                        last_pass[row, col] = now


@njit(cache=True)
def classify(  # type: ignore[no-untyped-def]  # noqa: C901
    walls, unknown, distance, standing, support, cell, corner, ends, kind, laser, poses, beyond
):
    """Changed beams against the map.

    Args:
        walls: (H, W) mapped walls.
        unknown: (H, W) unmapped cells.
        distance: (H, W) metres to the nearest wall.
        standing: (H, W) where something new stands, a cell of slack included.
        support: (H, W) cells with standing structure within `beyond`.
        cell: edge of a cell, m.
        corner: (2,) of cell (0, 0), m.
        ends: (N, B, 2) of the beams in the base frame.
        kind: (N, B) hit, miss or invalid.
        laser: (2,) start of the beams in the base frame.
        poses: (N, 3) in the grid's frame.
        beyond: metres by which a beam must differ.

    Returns:
        (N, B) int8: 0 unchanged, 1 appeared, 2 removed, and (N, B) int32 the flat index of the
        cell that changed, -1 where none did.
    """
    height, width = walls.shape
    change = np.zeros(kind.shape, dtype=np.int8)
    where = np.full(kind.shape, -1, dtype=np.int32)
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
            limit = length + beyond / cell
            expected, before_unknown = _first(walls, unknown, ox, oy, dx, dy, limit, beyond / cell)
            if kind[s, b] == HIT and expected > limit - 1e-6 and before_unknown > length:
                col, row = int(np.floor(ox + dx * length)), int(np.floor(oy + dy * length))
                inside = 0 <= row < height and 0 <= col < width
                if inside and standing[row, col] and distance[row, col] > beyond:
                    change[s, b], where[s, b] = 1, row * width + col
            elif expected + beyond / cell < length and expected < before_unknown:
                col = int(np.floor(ox + dx * (expected + 1e-6)))
                row = int(np.floor(oy + dy * (expected + 1e-6)))
                if not (0 <= row < height and 0 <= col < width) or support[row, col]:
                    continue
                # Along a wall a small error of the pose moves the expected end by metres: only a
                # beam whose neighbours are stopped as well is one the wall should have stopped.
                angle = 0.01 + 0.08 / (expected * cell + 0.1)
                ca, sa = np.cos(angle), np.sin(angle)
                grazing = False
                for side in (-1.0, 1.0):
                    tx, ty = ca * dx - side * sa * dy, side * sa * dx + ca * dy
                    near, _ = _first(walls, unknown, ox, oy, tx, ty, length, beyond / cell)
                    grazing = grazing or near + beyond / cell >= length
                if not grazing:
                    change[s, b], where[s, b] = 2, row * width + col
    return change, where


@njit(cache=True)
def _first(walls, unknown, x, y, dx, dy, limit, slack):  # type: ignore[no-untyped-def]
    """Distances in cells to the first wall and to the first unknown cell; inf where none.

    A mapper leaves a thin unknown seam before some walls: unknown cells nearer than `slack` before
    the wall do not count.
    """
    height, width = walls.shape
    col, row = int(np.floor(x)), int(np.floor(y))
    step_col, step_row = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    delta_col = np.inf if dx == 0.0 else abs(1.0 / dx)
    delta_row = np.inf if dy == 0.0 else abs(1.0 / dy)
    to_col = np.inf if dx == 0.0 else ((col + 1 - x) if dx > 0 else (x - col)) * delta_col
    to_row = np.inf if dy == 0.0 else ((row + 1 - y) if dy > 0 else (y - row)) * delta_row
    travelled, first_unknown = 0.0, np.inf
    while travelled <= limit:
        if not (0 <= row < height and 0 <= col < width):
            return np.inf, min(first_unknown, travelled)
        if walls[row, col]:
            if travelled - first_unknown <= slack:
                first_unknown = np.inf
            return travelled, first_unknown
        if unknown[row, col] and first_unknown == np.inf:
            first_unknown = travelled
        if to_col < to_row:
            travelled = to_col
            to_col += delta_col
            col += step_col
        else:
            travelled = to_row
            to_row += delta_row
            row += step_row
    return np.inf, first_unknown
