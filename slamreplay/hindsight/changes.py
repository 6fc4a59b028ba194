"""What of the map was not true: changed beams, changed cells and the regions they make."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt, label

from slamreplay.bundle.products import ChangedRegion, Changes
from slamreplay.geometry import se2
from slamreplay.hindsight.beams import INVALID, Beams
from slamreplay.hindsight.changed_beams import (
    APPEARED,
    NEW,
    REMOVED,
    SUPPORTED,
    UNKNOWN,
    WALL,
    changed_beams,
)
from slamreplay.hindsight.evidence import Evidence, gather
from slamreplay.hindsight.reach import with_proven_reach
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.matching.field import WorkingMap

#: A beam has changed, and structure is elsewhere, beyond this distance.
BEYOND_M = 0.25
#: Standing: seen for this long in all, and not passed through for more than twice as long.
STANDING_S, PASSES_PER_HIT = 4.0, 2.0
#: A mapped wall is gone when beams went through it for this long.
GONE_S = 1.0
#: Changed cells nearer than this are one region; regions seen by fewer scans are noise.
JOIN_M, MIN_VIEWS = 0.3, 5


def find_changes(
    grid: OccupancyGrid, working: WorkingMap, beams: Beams, poses: se2.Array
) -> Changes:
    """Changed beams of every scan, and the changed cells behind them.

    Args:
        grid: the map; the masks have its shape.
        working: the same map, as it is searched.
        beams: the scans.
        poses: (N, 3) of the base in the grid's frame, NaN where there is none.
    """
    poses = np.ascontiguousarray(poses)
    mapped = WALL * working.walls.astype(np.uint8) | UNKNOWN * working.unknown.astype(np.uint8)
    beams = with_proven_reach(
        mapped, working.resolution_m, working.corner_xy, beams, poses, BEYOND_M
    )
    evidence = gather(working, beams, poses)
    cells = mapped | _structure_bits(working, evidence)
    change, where = changed_beams(
        cells, working.resolution_m, working.corner_xy, beams, poses, BEYOND_M
    )
    valid = np.count_nonzero(beams.kind != INVALID, axis=1).astype(np.float64)
    valid[(valid == 0) | ~np.isfinite(poses).all(axis=1)] = np.nan
    appeared_share = np.count_nonzero(change == APPEARED, axis=1) / valid
    removed_share = np.count_nonzero(change == REMOVED, axis=1) / valid
    appeared = _mask(cells, where[change == APPEARED])
    passed = _fine(working, evidence.pass_s >= GONE_S, evidence.step)
    removed = _mask(cells, where[change == REMOVED])
    # What lies behind the first cell of a wall went with it.
    reach = 2 * round(BEYOND_M / working.resolution_m) + 1
    with_it = binary_dilation(removed, np.ones((reach, reach), dtype=bool))
    removed |= with_it & working.walls & passed & ((cells & SUPPORTED) == 0)
    regions = [
        region
        for kind, code, mask in (("appeared", APPEARED, appeared), ("removed", REMOVED, removed))
        for region in _regions(working, evidence, beams.t_ns, change == code, where, mask, kind)
    ]
    regions.sort(key=lambda r: (-r.area_m2, r.bbox_m))
    return Changes(
        _to_grid(grid, working, appeared),
        _to_grid(grid, working, removed) & grid.occupied,
        tuple(regions),
        beams.t_ns,
        appeared_share + removed_share,
        appeared_share,
        removed_share,
    )


def _structure_bits(working: WorkingMap, evidence: Evidence) -> NDArray[np.uint8]:
    """(H, W) what stands where, from what was seen and seen through."""
    hit_s, pass_s = evidence.hit_s, evidence.pass_s
    standing = (hit_s >= STANDING_S) & (pass_s <= PASSES_PER_HIT * hit_s)
    near = binary_dilation(standing, np.ones((3, 3), dtype=bool))
    apart_m = distance_transform_edt(~working.walls) * working.resolution_m
    # A mapped wall counts as there as soon as more was seen on it than through it: far walls and
    # dark ones are hit too seldom to be called standing.
    seen = standing | ((hit_s > 0.0) & (hit_s >= 0.5 * pass_s))
    seen = _fine(working, seen, evidence.step)
    seen_m = distance_transform_edt(~seen) * working.resolution_m if seen.any() else np.inf
    bits = np.zeros(working.walls.shape, dtype=np.uint8)
    bits |= NEW * (_fine(working, near, evidence.step) & (apart_m > BEYOND_M)).astype(np.uint8)
    bits |= SUPPORTED * np.broadcast_to(seen_m <= BEYOND_M, bits.shape).astype(np.uint8)
    return bits


def _fine(working: WorkingMap, mask: NDArray[np.bool_], step: int) -> NDArray[np.bool_]:
    height, width = working.walls.shape
    return np.repeat(np.repeat(mask, step, axis=0), step, axis=1)[:height, :width]


def _mask(cells: NDArray[np.uint8], index: NDArray[np.int32]) -> NDArray[np.bool_]:
    mask = np.zeros(cells.size, dtype=bool)
    mask[index] = True
    return mask.reshape(cells.shape)


def _regions(
    working: WorkingMap,
    evidence: Evidence,
    t_ns: NDArray[np.int64],
    changed: NDArray[np.bool_],
    where: NDArray[np.int32],
    mask: NDArray[np.bool_],
    kind: str,
) -> list[ChangedRegion]:
    reach = max(1, round(0.5 * JOIN_M / working.resolution_m))
    labels, count = label(binary_dilation(mask, np.ones((2 * reach + 1,) * 2, dtype=bool)))
    scan, beam = np.nonzero(changed)
    of_beam = labels.ravel()[where[scan, beam]]
    found = []
    for number in range(1, count + 1):
        scans = np.unique(scan[of_beam == number])
        if len(scans) < MIN_VIEWS:
            continue
        rows, cols = np.nonzero(mask & (labels == number))
        corner = working.corner_xy
        low = corner + np.array([cols.min(), rows.min()]) * working.resolution_m
        high = corner + np.array([cols.max() + 1, rows.max() + 1]) * working.resolution_m
        box = np.array([[low[0], low[1]], [high[0], low[1]], [low[0], high[1]], [high[0], high[1]]])
        box = se2.transform_points(working.origin_xyyaw, box)
        hit = evidence.hit_s[rows // evidence.step, cols // evidence.step].sum()
        gone = evidence.pass_s[rows // evidence.step, cols // evidence.step].sum()
        clear = (hit if kind == "appeared" else gone) / max(float(hit + gone), 1e-9)
        found.append(
            ChangedRegion(
                "appeared" if kind == "appeared" else "removed",
                (*box.min(axis=0).tolist(), *box.max(axis=0).tolist()),
                len(rows) * working.resolution_m**2,
                int(t_ns[scans[0]]),
                int(t_ns[scans[-1]]),
                len(scans),
                float(clear * (1.0 - np.exp(-len(scans) / 10.0))),
            )
        )
    return found


def _to_grid(
    grid: OccupancyGrid, working: WorkingMap, mask: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    step = round(working.resolution_m / grid.resolution_m)
    fine = np.repeat(np.repeat(mask, step, axis=0), step, axis=1)
    shift = np.rint(working.corner_xy[::-1] / grid.resolution_m).astype(np.int64)
    out = np.zeros(grid.cells.shape, dtype=bool)
    low = np.maximum(shift, 0)
    high = np.minimum(shift + np.array(fine.shape), out.shape)
    part = fine[low[0] - shift[0] : high[0] - shift[0], low[1] - shift[1] : high[1] - shift[1]]
    out[low[0] : high[0], low[1] : high[1]] = part
    return out
