"""Whether a cell was taken or free at each moment, from when it was seen and seen through."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

#: A bin in which a cell was only seen (or only seen through) speaks for it by 1; that a cell became
#: taken or free is believed from twice this on.
SWITCH_COST = 3.0


def taken(seen: NDArray[np.bool_], through: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(C, T) the most probable course of each cell between taken and free (Viterbi, two states).

    Args:
        seen: (C, T) something was seen there in that bin of time.
        through: (C, T) beams went through. A bin with both, or with neither, says nothing.
    """
    out = np.zeros(seen.shape, dtype=bool)
    _viterbi(seen, through, SWITCH_COST, out)
    return out


@njit(cache=True)
def _viterbi(seen, through, switch, out):  # type: ignore[no-untyped-def]
    total = seen.shape[1]
    came = np.zeros((total, 2), dtype=np.uint8)
    for c in range(seen.shape[0]):
        free, full = 0.0, 0.0
        for t in range(total):
            came[t, 0] = 1 if full - switch > free else 0
            came[t, 1] = 0 if free - switch > full else 1
            free, full = max(free, full - switch), max(full, free - switch)
            if seen[c, t] and not through[c, t]:
                full += 1.0
            elif through[c, t] and not seen[c, t]:
                free += 1.0
        state = 1 if full > free else 0
        for t in range(total - 1, -1, -1):
            out[c, t] = state == 1
            state = came[t, state]
