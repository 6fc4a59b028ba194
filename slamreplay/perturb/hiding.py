"""Beams that end on people instead of where they ended, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.perturb.passers import RADIUS_M, Met


def hide(
    ranges_m: NDArray[np.float32],
    hidden: NDArray[np.bool_],
    free_to_m: NDArray[np.float32],
    left: int,
    met: Met,
) -> int:
    """Shorten ranges (M,) to the people in front, and give how many more beams may be hidden.

    Args:
        ranges_m: (M,) written to.
        hidden: (M,) which of them somebody hides; written to.
        free_to_m: (M,) how far each beam sees without people, 0 where it says nothing.
        left: this many more are hidden at the most.
        met: people, who are gone through in order until nothing is left.
    """
    return _hide(
        ranges_m, hidden, free_to_m, left, RADIUS_M, met.start, met.low, met.high, met.middle,
        met.step_rad, met.apart_m,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _hide(  # type: ignore[no-untyped-def]
    ranges, hidden, free_to, left, radius, start, low, high, middle, step, apart
):
    for k in range(len(start)):
        for number in range(low[k], high[k] + 1):
            along = apart[k] * np.cos((number - middle[k]) * step[k])
            beside2 = apart[k] ** 2 - along**2
            if beside2 >= radius**2 or along <= 0.0:
                continue
            reach = along - np.sqrt(radius**2 - beside2)
            beam = start[k] + number
            if reach <= 0.0 or reach >= free_to[beam]:
                continue
            if not hidden[beam]:
                if left == 0:
                    return 0
                hidden[beam] = True
                left -= 1
            ranges[beam] = min(ranges[beam], reach)
    return left
