"""How far a beam without a return proves that space is free: what this lidar, in this log, sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, MISS, Beams
from slamreplay.hindsight.changed_beams import to_wall

BIN_M, MIN_BEAMS, SCANS = 1.0, 50, 300
#: Where more than this share of the beams that should meet a wall come back empty, a beam without
#: a return says nothing.
BLIND_SHARE = 0.5


def with_proven_reach(
    cells: NDArray[np.uint8],
    cell_m: float,
    corner_xy: se2.Array,
    beams: Beams,
    poses: se2.Array,
    near_m: float,
) -> Beams:
    """The same beams, those without a return cut where the lidar becomes blind.

    Data sheets promise a range for white walls met head-on. Here the beams whose wall the map
    expects at some distance are counted: returns from that wall against no return at all.

    Args:
        cells: (H, W) bits of `changed_beams`.
        cell_m: edge of a cell.
        corner_xy: (2,) corner of cell (0, 0), m.
        beams: the scans.
        poses: (N, 3) of the base in the grid's frame.
        near_m: a return this near to the expected wall comes from it.
    """
    rows = np.flatnonzero(np.isfinite(poses).all(axis=1))
    if not len(rows) or not (beams.kind == MISS).any():
        return beams
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), SCANS)).astype(np.int64)]
    ends, kind = beams.ends[rows], beams.kind[rows]
    expected = np.full(kind.shape, np.nan)
    here = np.ascontiguousarray(poses[rows])
    _expect(cells, cell_m, corner_xy, ends, kind, beams.laser_xy, here, near_m, expected)
    length = np.hypot(*np.moveaxis(ends - beams.laser_xy.astype(np.float32), -1, 0))
    back = np.isfinite(expected) & (kind == HIT) & (np.abs(length - expected) < near_m)
    empty = np.isfinite(expected) & (kind == MISS)
    far = int(np.nanmax(np.where(np.isfinite(expected), expected, 0.0)) / BIN_M) + 1
    met, missed = (
        np.bincount((expected[mask] / BIN_M).astype(np.int64), minlength=far)
        for mask in (back, empty)
    )
    blind = (met + missed >= MIN_BEAMS) & (missed > BLIND_SHARE * (met + missed))
    if not blind.any():
        return beams
    reach = float(np.flatnonzero(blind)[0]) * BIN_M
    away = beams.ends - beams.laser_xy.astype(np.float32)
    part = np.minimum(1.0, reach / np.maximum(np.hypot(away[..., 0], away[..., 1]), 1e-6))
    cut = beams.laser_xy.astype(np.float32) + away * part[..., None].astype(np.float32)
    return replace(beams, ends=np.where((beams.kind == MISS)[..., None], cut, beams.ends))


@njit(cache=True)
def _expect(  # type: ignore[no-untyped-def]
    cells, cell, corner, ends, kind, laser, poses, near_m, expected
):
    for s in range(poses.shape[0]):
        cos, sin = np.cos(poses[s, 2]), np.sin(poses[s, 2])
        px, py = (poses[s, 0] - corner[0]) / cell, (poses[s, 1] - corner[1]) / cell
        ox = px + (cos * laser[0] - sin * laser[1]) / cell
        oy = py + (sin * laser[0] + cos * laser[1]) / cell
        for b in range(ends.shape[1]):
            if kind[s, b] != HIT and kind[s, b] != MISS:
                continue
            dx = px + (cos * ends[s, b, 0] - sin * ends[s, b, 1]) / cell - ox
            dy = py + (sin * ends[s, b, 0] + cos * ends[s, b, 1]) / cell - oy
            length = np.sqrt(dx * dx + dy * dy)
            if length > 0.0:
                limit, seam = length + near_m / cell, near_m / cell
                wall = to_wall(cells, ox, oy, dx / length, dy / length, limit, seam)
                if 0.0 <= wall < np.inf:
                    expected[s, b] = wall * cell
