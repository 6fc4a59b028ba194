"""Upper bounds of a score field over squares of cells: what branch and bound prunes with.

A node of the search is a square of places and a run of headings. Its bound is the sum, over the
points, of the largest score that each can find from there: a lookup in the field max-pooled over
the square, as in Hess et al. (Real-time loop closure in 2D lidar SLAM, ICRA 2016), and over what
the point moves while the heading runs, which they do not group.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.matching.field import ScoreField

# These are compiled into bound_kernels: numba does not see that they change.
#: Squares have edges of 2, 4, 8, 16 and 32 cells; level 0 is the field itself.
LEVELS = 5
#: The longest run of headings that is bounded at once.
LONGEST_RUN = 8
#: How far points move in a run, in cells: each has tables of its own.
SPREADS = (2, 4, 8)
#: Scores are kept as bytes, rounded up, so that they stay bounds.
BYTE = 255


@dataclass(frozen=True, eq=False)
class Pyramid:
    """A field made ready for many searches.

    At a level whose squares have edge s, the nodes lie s cells apart. A pooled table is stored as
    s * s planes, one for each place of a cell in its square, so that what neighbouring nodes look
    up lies side by side.

    Attributes:
        field: what is searched.
        bounds: flat uint8: the tables of level 1 for each of `SPREADS`, then those of level 2, ...
        margin: empty cells before the first row and column of each table.
        padded: rows and columns of each table, multiples of the largest square.
    """

    field: ScoreField
    bounds: NDArray[np.uint8]
    margin: int
    padded: tuple[int, int]


def pyramid(field: ScoreField) -> Pyramid:
    """The bounds of a field: 15 bytes for each cell of it and of its margin."""
    largest = 1 << LEVELS
    margin = 2 * largest
    height, width = (-(-(n + margin) // largest) * largest for n in field.values.shape)
    base = np.zeros((height, width), dtype=np.uint8)
    inner = base[margin : margin + field.values.shape[0], margin : margin + field.values.shape[1]]
    inner[:] = np.ceil(np.clip(field.values, 0.0, 1.0) * np.float32(BYTE))
    size = height * width
    bounds = np.empty(LEVELS * len(SPREADS) * size, dtype=np.uint8)
    pooled, at = base, 0
    for level in range(1, LEVELS + 1):
        square = 1 << level
        pooled = _spread(pooled, square // 2)
        for spread in SPREADS:
            # A square wider by the spread is the union of two that overlap, or of a chain of them.
            wide = pooled
            for step in _steps(spread, square):
                wide = _spread(wide, step)
            planes = wide.reshape(height // square, square, width // square, square)
            target = bounds[at : at + size].reshape(square, square, height // square, -1)
            target[:] = planes.transpose(1, 3, 0, 2)
            at += size
    return Pyramid(field, bounds, margin, (height, width))


def _steps(spread: int, square: int) -> Sequence[int]:
    """Shifts, each no longer than what it widens, that together widen a square by `spread`."""
    steps = []
    while spread > 0:
        steps.append(min(spread, square))
        spread -= steps[-1]
        square += steps[-1]
    return steps


def _spread(table: NDArray[np.uint8], step: int) -> NDArray[np.uint8]:
    """Each cell's maximum with those `step` further along rows, columns and both."""
    rows = table.copy()
    np.maximum(table[:-step], table[step:], out=rows[:-step])
    out = rows.copy()
    np.maximum(rows[:, :-step], rows[:, step:], out=out[:, :-step])
    return out
