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
        np.full(hit_s.shape, -1e9),
        np.full(hit_s.shape, -1e9),
    )
    return Evidence(hit_s, pass_s, step)


@njit(cache=True)
def _gather(  # type: ignore[no-untyped-def]  # noqa: C901
    hit_s, pass_s, cell, corner, t, ends, kind, laser, poses, last_hit, last_pass
):
    height, width = hit_s.shape
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
