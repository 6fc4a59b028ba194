"""What beams met: the classes of every beam of one laser, scan by scan."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class Met(IntEnum):
    """What a beam met, cast from where hindsight says the robot was.

    MAPPED ended at a mapped wall; APPEARED on what stands where the map of that time shows nothing;
    REMOVED went through a mapped wall that is gone, wherever it ended; MOVING ended on something
    unmapped that did not stay. APPEARED and REMOVED are the changed beams that the verdict counts.
    OTHER says nothing: it returned from unmapped ground or not at all, or nobody knows where the
    robot was, or one beam alone decides nothing.
    """

    INVALID = 0
    MAPPED = 1
    APPEARED = 2
    REMOVED = 3
    MOVING = 4
    OTHER = 5


@dataclass(frozen=True, eq=False)
class BeamsMet:
    """Classes of the beams of one laser.

    Attributes:
        t_ns: (N,) scan times, ascending.
        met: (N, B) uint8 of Met, in the order in which the beams were recorded.
    """

    t_ns: NDArray[np.int64]
    met: NDArray[np.uint8]

    def at(self, t_ns: NDArray[np.int64], width: int) -> NDArray[np.uint8]:
        """(M, width) classes of scans by their times (M,), ascending.

        Scans of one and the same time are told apart by their order. Of scans that are not known
        every beam is OTHER; beams beyond those that are known are INVALID.
        """
        met = np.full((len(t_ns), width), Met.OTHER, dtype=np.uint8)
        again = np.arange(len(t_ns)) - np.searchsorted(t_ns, t_ns)
        row = np.searchsorted(self.t_ns, t_ns) + again
        known = row < len(self.t_ns)
        known[known] = self.t_ns[row[known]] == t_ns[known]
        met[known] = padded(self.met[row[known]], width)[:, :width]
        return met


def padded(met: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """(N, B) classes with INVALID beams behind, up to `width` of them."""
    lacking = max(width - met.shape[1], 0)
    return np.pad(met, [(0, 0), (0, lacking)], constant_values=Met.INVALID)
