"""The map as the log's end shows it: what is to be drawn, and what is to be wiped out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.hindsight.evidence import BIN_S, Lattice
from slamreplay.hindsight.gone import Gone
from slamreplay.hindsight.standing import STANDING_S, Standing
from slamreplay.maps.grid import FREE, OCCUPIED, OccupancyGrid

#: The map is corrected so often: what was behind a thing that is gone shows only once that is
#: wiped out, and of what was drawn beams may pass through some.
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Edits:
    """What one look at a map would change of it.

    Attributes:
        occupied: (H, W) cells of the grid in which something stood at the end.
        free: (H, W) cells of the grid that were empty at the end.
    """

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]


def last_state(
    where: Lattice, new: Standing, away: Gone
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(H, W) evidence cells that are taken at the end, and those whose walls are gone at the end.

    A place that beams went through is taken only if something was seen there for a while after
    that, and for longer in all: the last look may be noise, seen from far away, and what stays for
    less than its place is empty belongs on no map.
    """
    emptied = _last(new.empty)
    after = np.arange(where.bin_count) > emptied[:, None]
    seen = new.seen & new.holds
    seen_s = np.count_nonzero(seen & after, axis=1) * BIN_S
    mostly = np.count_nonzero(seen, axis=1) >= np.count_nonzero(new.empty, axis=1)
    stands = mostly & (seen_s >= np.where(emptied >= 0, STANDING_S, BIN_S))
    is_gone = _last(away.holds & away.through) > _last(away.seen & ~away.holds)
    return _on(where, new.slots, stands), _on(where, away.slots, is_gone)


def corrected(
    grid: OccupancyGrid, first: Edits, look_again: Callable[[OccupancyGrid], Edits | None]
) -> NDArray[np.int8]:
    """(H, W) the grid's cells, corrected so that the log's own beams agree with them.

    Each cell is changed at most once, and put back for good where the beams contradict that.

    Args:
        grid: the map.
        first: what to change of it.
        look_again: what to change of a corrected one; None where no wall is left.
    """
    edits: Edits | None = first
    cells = grid.cells
    changed = np.zeros(cells.shape, dtype=bool)
    back = changed.copy()
    for turn in range(ROUNDS):
        if turn:
            now = OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)
            edits = look_again(now)
        if edits is None:
            break
        touched = edits.occupied | edits.free
        wrong, fresh = touched & changed & ~back, touched & ~changed
        if not (wrong.any() or fresh.any()):
            break
        cells = np.where(wrong, grid.cells, cells)
        cells = np.where(fresh, np.where(edits.occupied, OCCUPIED, FREE), cells).astype(np.int8)
        changed |= fresh
        back |= wrong
    return cells


def _last(when: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(C,) the last bin of each row that holds, -1 without one."""
    if not when.size:
        return np.full(len(when), -1, dtype=np.int64)
    last = when.shape[1] - 1 - np.argmax(when[:, ::-1], axis=1)
    return np.where(when.any(axis=1), last, -1)


def _on(where: Lattice, slots: NDArray[np.int32], is_so: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) what holds of numbered cells, on the lattice."""
    out = np.zeros(where.shape, dtype=bool)
    out[slots >= 0] = is_so[slots[slots >= 0]]
    return out
