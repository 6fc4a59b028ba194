"""What only a mapper at work did, not the world: walls it was late to draw, or drew in vain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.hindsight.earlier import LaidOver, near_walls
from slamreplay.hindsight.evidence import Lattice
from slamreplay.hindsight.gone import Gone
from slamreplay.hindsight.standing import Standing
from slamreplay.matching.field import WorkingMap

#: Bins of time in which a cell may be seen empty, or taken, by noise of the poses.
_BY_NOISE = 3


def drawn_late(
    where: Lattice, working: WorkingMap, over: LaidOver, new: Standing
) -> NDArray[np.bool_]:
    """(C,) cells of something new that stood there all along, and that a mapper was late to draw.

    A mapper calls the ground before a far wall free and draws the wall itself with the next
    version, or puts it elsewhere until it closes a loop. That is no change where the log's own
    mapper called the cell free, it was never seen empty before, and the newest map has the wall.
    """
    own = where.coarse(over.own_free & near_walls(working))
    return _of_slots(new.slots, own) & _never(new.empty, new.holds)


def drawn_wrongly(
    where: Lattice, working: WorkingMap, over: LaidOver, away: Gone
) -> NDArray[np.bool_]:
    """(C,) cells of walls that are gone and never were there: a mapper put them there.

    The log's own mapper has drawn the wall, nothing was ever seen there, and the newest map has
    none there any more.
    """
    own = where.coarse(over.own_wall & ~working.walls)
    return _of_slots(away.slots, own) & _never(away.seen, away.holds)


def _of_slots(slots: NDArray[np.int32], mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(C,) what holds of the numbered cells."""
    asked = slots >= 0
    out = np.zeros(np.count_nonzero(asked), dtype=bool)
    out[slots[asked]] = mask[asked]
    return out


def _never(what: NDArray[np.bool_], holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(C,) rows in which something (C, T) is in no bin before the first that holds, noise apart."""
    before = np.cumsum(holds, axis=1) == 0
    return np.asarray(np.count_nonzero(what & before, axis=1) <= _BY_NOISE)
