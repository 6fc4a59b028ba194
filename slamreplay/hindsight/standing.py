"""What stands where the map shows nothing: seen for a while, and not seen to come or go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from slamreplay.hindsight.changed_beams import NEARER, BeamsOnMap
from slamreplay.hindsight.evidence import BIN_S, Lattice, bins_of_each, marks
from slamreplay.hindsight.occupancy import taken

#: Standing: seen at one place for this long in all.
STANDING_S = 4.0
#: Cells seen for this long belong to what stands beside them.
BESIDE_S = 1.0
#: How large a thing is, is asked of the parts seen for this share of the longest time: what sways
#: or hangs about it is seen more briefly.
CORE_SHARE = 0.6
#: Somebody was watching if the cell was seen empty no longer than this before or after.
WATCHED_S = 3.0
#: What is no larger, noise and the lattice included, may be a person, m.
PERSON_M = 0.65
#: A person stands still for some seconds, but seldom longer than this: seen to come or to go, seen
#: to do both; and where the place was empty at another time, unwatched.
PERSON_CAME_S, PERSON_CAME_AND_WENT_S, PERSON_ELSEWHEN_S = 20.0, 40.0, 20.0
#: Larger things that were seen to come and to go are loads in motion unless they stayed this long.
LOAD_S = 20.0
#: Where more than this share of what was seen contradicts that it came and went as a whole, it has
#: moved along, unless it stayed for so long that this is noise of the poses.
CREPT_SHARE, CREPT_S = 0.35, 15.0
#: What stands is met at nearly every look at it: thin legs at this share of them or more. Where
#: people pass again and again, or follow each other, beams reach through in between.
STEADY_SHARE = 0.75
#: A cell was empty if beams went through it in so many bins.
_TWICE = 2


@dataclass(frozen=True, eq=False)
class Standing:
    """Cells of the evidence lattice on which something new stood.

    Attributes:
        slots: (H, W) int32 row of each cell in `holds`, -1 where nothing new was seen.
        holds: (C, T) something stood there in that bin.
        seen: (C, T) something was seen there.
        empty: (C, T) beams went through, and nothing was seen there about that time.
        seen_s: (C,) for how long it was seen.
        through_s: (C,) for how long it was seen through while it stood, by noise or else.
    """

    slots: NDArray[np.int32]
    holds: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    empty: NDArray[np.bool_]
    seen_s: NDArray[np.float64]
    through_s: NDArray[np.float64]


def asked_cells(where: Lattice, on_map: BeamsOnMap) -> tuple[NDArray[np.int32], int]:
    """(H, W) numbers of the cells worth following over time: something new was seen there twice."""
    scan, beam = np.nonzero(on_map.says == NEARER)
    cells = where.cells_of(on_map.where[scan, beam])
    count = bins_of_each(where, cells, where.bins[scan])
    padded = np.pad(count, 1)
    height, width = where.shape
    around = sum(
        padded[r : r + height, c : c + width].astype(np.int64) for r in range(3) for c in range(3)
    )
    asked = (count > 0) & (around * BIN_S >= BESIDE_S)
    slots = np.full(where.shape, -1, dtype=np.int32)
    slots[asked] = np.arange(np.count_nonzero(asked), dtype=np.int32)
    return slots, int(np.count_nonzero(asked))


def standing(
    where: Lattice,
    on_map: BeamsOnMap,
    slots: NDArray[np.int32],
    through: NDArray[np.bool_],
    ends: tuple[NDArray[np.int64], NDArray[np.int32]],
) -> Standing:
    """What of the new things stood, and when.

    Args:
        where: the lattice.
        on_map: the beams against the map.
        slots: (H, W) of `asked_cells`.
        through: (C, T) when those cells were seen through.
        ends: (K,) cells and bins in which any beam ended, whatever it says of the map.
    """
    scan, beam = np.nonzero(on_map.says == NEARER)
    cells = where.cells_of(on_map.where[scan, beam])
    count = len(through)
    seen = marks(where, cells, where.bins[scan], slots, 1, count)
    # Beams pass the corners of what stands: only where nothing is seen about the same time is the
    # cell empty. Beams that came over unmapped cells say nothing of the map, but they ended there.
    met = seen | marks(where, *ends, slots, 1, count)
    about = met.copy()
    about[:, 1:] |= met[:, :-1]
    about[:, :-1] |= met[:, 1:]
    empty = through & ~about
    state = taken(seen, empty)
    runs = _longest_runs(state, seen)
    first, last, seen_s = runs.T[0], runs.T[1], runs.T[2] * BIN_S
    bins = np.arange(where.bin_count)
    inside = (bins >= first[:, None]) & (bins <= last[:, None])
    until = nearest_empty(empty & (bins < first[:, None]), earlier=True)
    again = nearest_empty(empty & (bins > last[:, None]), earlier=False)
    course = BIN_S * np.column_stack([until, first, last, again])
    looked = (seen | through) & inside
    count_met, count_looked = (np.count_nonzero(m, axis=1) for m in (met & looked, looked))
    steady = count_met / np.maximum(count_looked, 1)
    holds = inside & things(where, slots, seen_s, course, steady)[:, None]
    return Standing(
        slots, holds, seen, empty, seen_s, np.count_nonzero(empty & inside, axis=1) * BIN_S
    )


def _longest_runs(state: NDArray[np.bool_], seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(C, 3) first and last bin in which it was seen, and the number of such bins, of each cell.

    Of the runs in which a cell is taken, the one in which most was seen.
    """
    out = np.zeros((len(state), 3), dtype=np.int64)
    out[:, 1] = -1
    if not state.size:
        return out
    padded = np.pad(state, ((0, 0), (1, 1)))
    edge = np.diff(padded.astype(np.int8), axis=1)
    cell, start = np.nonzero(edge == 1)
    stop = np.nonzero(edge == -1)[1]
    total = np.pad(np.cumsum(seen, axis=1), ((0, 0), (1, 0)))
    bins: NDArray[np.int64] = total[cell, stop] - total[cell, start]
    order = np.argsort(bins, kind="stable")
    cell, start, stop, bins = cell[order], start[order], stop[order], bins[order]
    best = np.full(len(state), -1, dtype=np.int64)
    best[cell] = np.arange(len(cell))  # the last one written has most
    for c in np.flatnonzero(best >= 0).tolist():
        k = best[c]
        when = np.flatnonzero(seen[c, start[k] : stop[k]])
        if len(when):
            out[c] = start[k] + when[0], start[k] + when[-1], bins[k]
    return out


def nearest_empty(empty: NDArray[np.bool_], *, earlier: bool) -> NDArray[np.float64]:
    """(C,) last (or first) bin in which each cell was empty, -inf (or inf) without one.

    One bin alone is noise of the poses along a face: the second one counts.
    """
    when = empty if earlier else empty[:, ::-1]
    later = np.cumsum(when[:, ::-1], axis=1)[:, ::-1]  # how often from this bin on
    count = when.shape[1]
    often = later >= _TWICE
    second = count - 1 - np.argmax(often[:, ::-1], axis=1) if count else np.zeros(len(when))
    out = np.where(often.any(axis=1), second, -np.inf)
    return out if earlier else np.where(np.isfinite(out), count - 1 - out, np.inf)


def things(
    where: Lattice,
    slots: NDArray[np.int32],
    seen_s: NDArray[np.float64],
    course_s: NDArray[np.float64],
    steady: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """(C,) which cells belong to something that stands: connected ones are one thing.

    Args:
        where: the lattice.
        slots: (H, W) numbers of the cells.
        seen_s: (C,) for how long each was seen.
        course_s: (C, 4) when it was last empty before, first and last seen, and next empty.
        steady: (C,) share of the looks at each, while it was taken, that met something there.
    """
    part = np.zeros(where.shape, dtype=bool)
    cells = np.argwhere(slots >= 0)  # in the order of the slots
    kept = seen_s >= BESIDE_S
    part[tuple(cells[kept].T)] = True
    labels, count = label(part, np.ones((3, 3)))
    thing = np.where(kept, labels[tuple(cells.T)], 0)
    out = np.zeros(len(cells), dtype=bool)
    order = np.argsort(thing, kind="stable")
    bounds = np.searchsorted(thing[order], np.arange(1, count + 2))
    for k in range(count):
        of_it = order[bounds[k] : bounds[k + 1]]
        if np.average(steady[of_it], weights=seen_s[of_it]) < STEADY_SHARE:
            continue
        longest_s = float(seen_s[of_it].max())
        core = of_it[seen_s[of_it] >= max(min(STANDING_S, longest_s), CORE_SHARE * longest_s)]
        size_m = float(np.ptp(cells[core], axis=0).max() + 1) * where.cell_m
        out[of_it] = longest_s >= _needed_s(size_m, seen_s[core], course_s[core])
    return out


def _needed_s(size_m: float, seen_s: NDArray[np.float64], course_s: NDArray[np.float64]) -> float:
    """For how long something must have stood to be a change and not a person or a load."""
    until, first, last, again = course_s.T
    # What comes comes whole: if one part of the place was still empty after another was taken,
    # something moved along there.
    # Parts that are taken to the end came into view one by one, or were parked: they count not.
    crept = (until > np.quantile(first, 0.1) + 1.0) & np.isfinite(again)
    crept |= again < np.quantile(last, 0.9) - 1.0
    if np.average(crept, weights=seen_s) > CREPT_SHARE:
        return max(CREPT_S, _needed_unless_it_crept_s(size_m, course_s))
    return _needed_unless_it_crept_s(size_m, course_s)


def _needed_unless_it_crept_s(size_m: float, course_s: NDArray[np.float64]) -> float:
    until, first, last, again = course_s.T
    came = float(np.mean(first - until <= WATCHED_S)) > 0.5
    went = float(np.mean(again - last <= WATCHED_S)) > 0.5
    if size_m > PERSON_M:
        return LOAD_S if came and went else STANDING_S
    if came or went:
        return PERSON_CAME_AND_WENT_S if came and went else PERSON_CAME_S
    elsewhen = np.isfinite(until) | np.isfinite(again)
    return PERSON_ELSEWHEN_S if float(np.mean(elsewhen)) > 0.5 else STANDING_S
