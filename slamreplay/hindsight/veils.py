"""Veils: returns from between an edge and what lies behind it, where nothing is.

A beam that half meets an edge measures something between both ranges (a mixed pixel). Behind each
leg of a person hangs such a veil. Points far apart on a wall that beams graze look the same, and
say as little.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.hindsight.beams import HIT, Beams

#: Neighbours on one surface lie nearer than this, m, or in a line that the beam meets at more than
#: 10 degrees.
APART_M, ALONG = 0.12, float(np.sin(np.radians(10.0)))


def veils(beams: Beams) -> NDArray[np.bool_]:
    """(N, B) hits that lie behind one neighbour and before the other, both far off in depth."""
    out = np.zeros(beams.kind.shape, dtype=bool)
    _veils(beams.ends, beams.kind, beams.laser_xy.astype(np.float32), out)
    return out


@njit(cache=True)
def _veils(ends, kind, laser, out):  # type: ignore[no-untyped-def]
    for s in range(kind.shape[0]):
        for b in range(1, kind.shape[1] - 1):
            if kind[s, b] != HIT:
                continue
            x, y = ends[s, b, 0] - laser[0], ends[s, b, 1] - laser[1]
            reach = np.sqrt(x * x + y * y)
            nearer, farther = 0, 0
            for k in (b - 1, b + 1):
                if kind[s, k] != HIT:  # nothing came back from behind
                    farther += 1
                    continue
                dx, dy = ends[s, k, 0] - ends[s, b, 0], ends[s, k, 1] - ends[s, b, 1]
                length = np.sqrt(dx * dx + dy * dy)
                if length <= APART_M or abs(dx * y - dy * x) >= ALONG * length * reach:
                    break
                if dx * x + dy * y < 0.0:
                    nearer += 1
                else:
                    farther += 1
            out[s, b] = nearer == 1 and farther == 1
