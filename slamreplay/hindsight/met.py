"""What each beam met: the map, what is new, what is gone, or what only passed by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.met import Met
from slamreplay.hindsight.beams import INVALID, Beams
from slamreplay.hindsight.changed_beams import MET, NEARER, BeamsOnMap
from slamreplay.hindsight.evidence import Lattice, Passes
from slamreplay.hindsight.standing import Standing

#: Ends of two neighbouring beams this near are of one thing, m: legs and the gaps between beams at
#: some metres.
TOGETHER_M = 0.3
#: A cell through which beams went in so many bins was empty.
_TWICE = 2


def what_was_met(
    beams: Beams,
    laid: BeamsOnMap,
    is_new: NDArray[np.bool_],
    is_gone: NDArray[np.bool_],
    may_pass: NDArray[np.bool_],
) -> NDArray[np.uint8]:
    """(N, B) classes of Met.

    Args:
        beams: the scans.
        laid: the beams against the map of their time; what says nothing of it is silent.
        is_new: (N, B) beams that ended on what stands where the map shows nothing.
        is_gone: (N, B) beams that went through a mapped wall that is gone.
        may_pass: (N, B) beams that ended where something did not stay.
    """
    met = np.full(beams.kind.shape, Met.OTHER, dtype=np.uint8)
    met[laid.says == MET] = Met.MAPPED
    met[may_pass & has_neighbour(beams, laid.says == NEARER)] = Met.MOVING
    met[is_new], met[is_gone] = Met.APPEARED, Met.REMOVED
    met[beams.kind == INVALID] = Met.INVALID
    return met


def passing(
    where: Lattice, laid: BeamsOnMap, new: Standing, passed: Passes, stood: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(N, B) beams that ended nearer than the map says, where nothing stayed.

    The place was empty at another time: what was seen too briefly, and never looked through, may
    stand there still.

    Args:
        where: the lattice.
        laid: the beams against the map, silent where they tell of no place.
        new: what was seen in the places that were asked about.
        passed: what was seen through.
        stood: (N, B) beams that ended on what stayed, whether or not it is a change.
    """
    empty = np.asarray(passed.bin_count >= _TWICE)
    asked = new.slots >= 0  # of those it is known when something was seen meanwhile
    empty[asked] = (np.count_nonzero(new.empty, axis=1) >= _TWICE)[new.slots[asked]]
    out = (laid.says == NEARER) & ~stood
    out[out] = empty.ravel()[where.cells_of(laid.where[out])]
    return np.asarray(out)


def has_neighbour(beams: Beams, those: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N, B) those beams that ended beside the end of another one of them, next to it."""
    scan, beam = np.nonzero(those[:, 1:] & those[:, :-1])
    step = beams.ends[scan, beam + 1] - beams.ends[scan, beam]
    near = np.hypot(step[:, 0], step[:, 1]) <= TOGETHER_M
    out = np.zeros_like(those)
    out[scan[near], beam[near]] = out[scan[near], beam[near] + 1] = True
    return out
