"""What of the map was not true: changed beams, changed cells and the regions they make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.met import BeamsMet
from slamreplay.bundle.products import Changes
from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, INVALID, MISS, Beams
from slamreplay.hindsight.changed_beams import BEYOND, BEYOND_M, NEARER, SILENT, BeamsOnMap
from slamreplay.hindsight.correction import Edits, corrected, last_state
from slamreplay.hindsight.earlier import Earlier, laid_over, near_walls
from slamreplay.hindsight.emptied import empty_since, went_with_it
from slamreplay.hindsight.evidence import Lattice, end_cells, lattice, passes
from slamreplay.hindsight.freshness import freshness_of
from slamreplay.hindsight.gone import gone
from slamreplay.hindsight.mapper import drawn_late, drawn_wrongly
from slamreplay.hindsight.met import passing, what_was_met
from slamreplay.hindsight.reach import is_lossy, proven_reach_m
from slamreplay.hindsight.regions import Contradictions, changed_regions
from slamreplay.hindsight.standing import asked_cells, standing
from slamreplay.hindsight.veils import veils
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.matching.field import WorkingMap, working_map


def find_changes(
    grid: OccupancyGrid,
    working: WorkingMap,
    beams: Beams,
    poses: se2.Array,
    *,
    earlier: Sequence[Earlier] = (),
    correct_map: bool = False,
) -> Changes:
    """Changed beams of every scan, and the changed cells behind them.

    Args:
        grid: the map; the masks have its shape.
        working: the same map, as it is searched.
        beams: the scans.
        poses: (N, 3) of the base in the grid's frame, NaN where there is none.
        earlier: versions that held before this one: beams of their time are compared with them.
            What is to be corrected of this map, and how old its claims are, the whole log says.
        correct_map: propose a map, too: it is checked by looking again, which takes as long again.
    """
    poses = np.ascontiguousarray(poses)
    changes, edits = _look(grid, working, earlier, beams, poses)
    if earlier:
        of_newest, edits = _look(grid, working, (), beams, poses)
        changes = replace(changes, freshness=of_newest.freshness)
    if not correct_map:
        return changes

    def look_again(now: OccupancyGrid) -> Edits | None:
        walls = working_map(now)
        return None if walls is None else _look(now, walls, (), beams, poses)[1]

    return replace(changes, corrected=corrected(grid, edits, look_again))


def _look(
    grid: OccupancyGrid,
    working: WorkingMap,
    earlier: Sequence[Earlier],
    beams: Beams,
    poses: se2.Array,
) -> tuple[Changes, Edits]:
    """What contradicts the map of its time, and how to mend this one."""
    over = laid_over(working, earlier, beams, poses)
    laid, drawn = over.beams, over.drawn
    reach_m = proven_reach_m(beams, laid)
    blind = (beams.kind == MISS) & (laid.says == BEYOND) & ~(laid.wall_m + BEYOND_M < reach_m)
    laid.says[blind] = SILENT
    laid.says[over.near] = SILENT
    veil = veils(beams)
    solid = replace(laid, says=np.where(veil, np.int8(SILENT), laid.says))
    where = lattice(working, beams.t_ns)
    if is_lossy(where, beams, laid):
        laid.is_sure[beams.kind == MISS] = False
        reach_m = 0.0
    slots, count = asked_cells(where, solid)
    passed = passes(where, beams, poses, reach_m, slots, count)
    ends = end_cells(where, beams, poses)
    bins = np.broadcast_to(where.bins[:, None], beams.kind.shape)[beams.kind == HIT]
    ended = (ends[ends >= 0], bins[ends >= 0])
    solid_ends = (ends >= 0) & ~veil[beams.kind == HIT]  # a veil fills no place, but hides a wall
    met_by = (ends[solid_ends], bins[solid_ends])
    new = standing(where, solid, slots, passed.through, met_by)
    away = gone(where, laid, ended)
    stood = new  # whatever maps say of it later
    if earlier:
        late, wrong = (
            drawn_late(where, working, over, new),
            drawn_wrongly(where, working, over, away),
        )
        new = replace(new, holds=new.holds & ~late[:, None])
        away = replace(away, holds=away.holds & ~wrong[:, None])
    is_new = _at(where, laid, NEARER, new.slots, new.holds)
    is_gone = _at(where, laid, BEYOND, away.slots, away.holds)
    may_pass = passing(where, beams, poses, solid, stood, passed)
    met = what_was_met(beams, laid, over.at_wall, (is_new, is_gone), may_pass)

    valid = np.count_nonzero(beams.kind != INVALID, axis=1).astype(np.float64)
    valid[(valid == 0) | ~np.isfinite(poses).all(axis=1)] = np.nan
    appeared_share = np.count_nonzero(is_new, axis=1) / valid
    removed_share = np.count_nonzero(is_gone, axis=1) / valid
    appeared = _mask(working, laid.where[is_new])
    removed = _mask(working, laid.where[is_gone])
    empty = where.fine(empty_since(where, ended, passed), working.walls.shape)
    with_it = went_with_it(drawn, removed, empty)
    first, removed = removed, removed | (with_it & drawn.walls)
    new_clear = _clear(working, where, new.slots, new.seen_s, new.through_s)
    gone_clear = _clear(working, where, away.slots, away.through_s, away.seen_s)
    regions = changed_regions(
        drawn,
        Contradictions("appeared", appeared, is_new, laid.where, beams.t_ns, new_clear),
        Contradictions("removed", removed, is_gone, laid.where, beams.t_ns, gone_clear),
    )
    if earlier:  # a later version has drawn it
        appeared = appeared & ~near_walls(working)
    stands, wiped = (where.fine(m, working.walls.shape) for m in last_state(where, new, away))
    opened = _to_grid(grid, working, with_it & working.unknown)
    occupied = _to_grid(grid, working, appeared & stands)
    free = _to_grid(grid, working, removed & (wiped | ~first)) & grid.occupied
    edits = Edits(occupied, (free | opened) & ~occupied)
    changes = Changes(
        _to_grid(grid, working, appeared),
        _to_grid(grid, working, removed) & grid.occupied,
        regions,
        beams.t_ns,
        appeared_share + removed_share,
        appeared_share,
        removed_share,
        opened,
        freshness_of(working, where, laid, beams.t_ns, passed, new, away, removed),
        met=(BeamsMet(beams.t_ns, met),),
    )
    return changes, edits


def _at(
    where: Lattice,
    laid: BeamsOnMap,
    says: int,
    slots: NDArray[np.int32],
    holds: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """(N, B) beams that say so of a cell of which it holds at their time."""
    scan, beam = np.nonzero(laid.says == says)
    slot = slots.ravel()[where.cells_of(laid.where[scan, beam])]
    true = slot >= 0
    true[true] = holds[slot[true], where.bins[scan[true]]]
    out = np.zeros(laid.says.shape, dtype=bool)
    out[scan[true], beam[true]] = True
    return out


def _mask(working: WorkingMap, index: NDArray[np.int32]) -> NDArray[np.bool_]:
    mask = np.zeros(working.walls.size, dtype=bool)
    mask[index] = True
    return mask.reshape(working.walls.shape)


def _clear(
    working: WorkingMap,
    where: Lattice,
    slots: NDArray[np.int32],
    for_s: NDArray[np.float64],
    against_s: NDArray[np.float64],
) -> se2.Array:
    """(H, W) share of the time for which a cell was seen as the change says."""
    share = np.append(for_s / np.maximum(for_s + against_s, 1e-9), 1.0)
    return where.fine(share[slots], working.walls.shape)


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
