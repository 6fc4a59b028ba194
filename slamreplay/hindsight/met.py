"""What each beam met: the map, what is new, what is gone, or what only passed by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.met import Met
from slamreplay.geometry import se2
from slamreplay.hindsight.beams import INVALID, Beams
from slamreplay.hindsight.changed_beams import MET, NEARER, BeamsOnMap
from slamreplay.hindsight.evidence import Lattice, Passes
from slamreplay.hindsight.standing import Standing

#: Ends of two neighbouring beams this near are of one thing, m: legs and the gaps between beams at
#: some metres.
TOGETHER_M = 0.3
#: So far behind a beam's end it is looked whether that place was empty once, m.
BEHIND_M = 0.15
#: A cell through which beams went in so many bins was empty.
_TWICE = 2


def what_was_met(
    beams: Beams,
    laid: BeamsOnMap,
    at_wall: NDArray[np.bool_],
    changed: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    may_pass: NDArray[np.bool_],
) -> NDArray[np.uint8]:
    """(N, B) classes of Met.

    Args:
        beams: the scans.
        laid: the beams against the map of their time; what says nothing of it is silent.
        at_wall: (N, B) hits that ended at a mapped wall, also if they say nothing of it: past an
            edge, or over unmapped cells.
        changed: (N, B) each: beams that ended on what stands where the map shows nothing, and
            those that went through a mapped wall that is gone.
        may_pass: (N, B) beams that ended where something did not stay.
    """
    is_new, is_gone = changed
    met = np.full(beams.kind.shape, Met.OTHER, dtype=np.uint8)
    met[(laid.says == MET) | at_wall] = Met.MAPPED
    met[may_pass & has_neighbour(beams, laid.says == NEARER)] = Met.MOVING
    met[is_new], met[is_gone] = Met.APPEARED, Met.REMOVED
    met[beams.kind == INVALID] = Met.INVALID
    return met


def passing(
    where: Lattice,
    beams: Beams,
    poses: se2.Array,
    laid: BeamsOnMap,
    new: Standing,
    passed: Passes,
) -> NDArray[np.bool_]:
    """(N, B) beams that ended nearer than the map says, where nothing stayed.

    The place was empty at another time, somewhat behind the end as well (beams graze the faces of
    what stands): what was seen too briefly, and never looked through, may stand there still. Nor is
    it beside what stood at that time, whether or not that is a change: beams that half meet an edge
    end about it.

    Args:
        where: the lattice.
        beams: the scans.
        poses: (N, 3) of the base in the grid's frame.
        laid: the beams against the map, silent where they tell of no place.
        new: what was seen in the places that were asked about.
        passed: what was seen through.
    """
    empty = np.asarray(passed.bin_count >= _TWICE)
    asked = new.slots >= 0  # of those it is known when something was seen meanwhile
    empty[asked] = (np.count_nonzero(new.empty, axis=1) >= _TWICE)[new.slots[asked]]
    scan, beam = np.nonzero(laid.says == NEARER)
    cell = where.cells_of(laid.where[scan, beam])
    did_pass = empty.ravel()[cell] & _behind(where, beams, poses, scan, beam, empty)
    slots = np.pad(new.slots, 1, constant_values=-1)
    row, col = np.divmod(cell, where.shape[1])
    for down in range(3):
        for right in range(3):
            slot = slots[row + down, col + right]
            near = slot >= 0
            did_pass[near] &= ~new.holds[slot[near], where.bins[scan[near]]]
    out = np.zeros(laid.says.shape, dtype=bool)
    out[scan[did_pass], beam[did_pass]] = True
    return out


def _behind(
    where: Lattice,
    beams: Beams,
    poses: se2.Array,
    scan: NDArray[np.int64],
    beam: NDArray[np.int64],
    empty: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """(K,) whether the place behind the ends of beams (K,) is one of the empty cells (H, W)."""
    ends = beams.ends[scan, beam].astype(np.float64)
    along = ends - beams.laser_xy
    along *= BEHIND_M / np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    xy = se2.transform_points(poses[scan], (ends + along)[:, None, :])[:, 0, :]
    col, row = np.floor((xy - where.corner_xy) / where.cell_m).astype(np.int64).T
    inside = (row >= 0) & (row < where.shape[0]) & (col >= 0) & (col < where.shape[1])
    inside[inside] = empty[row[inside], col[inside]]
    return np.asarray(inside)


def has_neighbour(beams: Beams, those: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N, B) those beams that ended beside the end of another one of them, next to it."""
    scan, beam = np.nonzero(those[:, 1:] & those[:, :-1])
    step = beams.ends[scan, beam + 1] - beams.ends[scan, beam]
    near = np.hypot(step[:, 0], step[:, 1]) <= TOGETHER_M
    out = np.zeros_like(those)
    out[scan[near], beam[near]] = out[scan[near], beam[near] + 1] = True
    return out
