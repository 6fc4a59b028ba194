"""How old the map's claims are: when each cell was last confirmed, and when last contradicted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.geometry import se2

NEVER = -1


@dataclass(frozen=True, eq=False)
class Freshness:
    """What a log saw of a map, on a lattice of its own (0.1 m, or the map's cells if larger).

    A wall is confirmed by a beam that ends on it and contradicted by one that goes through it while
    it is gone; free space is confirmed by a beam that goes through and contradicted by what stands
    there. People and loads in motion contradict nothing. Nothing is said of unmapped cells.

    Attributes:
        confirmed_ns: (H, W) int64, on the bundle's clock; `NEVER` where the log does not tell.
        contradicted_ns: (H, W) likewise.
        resolution_m: edge of a cell.
        origin_xyyaw: (3,) pose of the lower left corner of cell (0, 0) in the map frame.
        end_ns: when the log ended: all that is known was known then.
    """

    confirmed_ns: NDArray[np.int64]
    contradicted_ns: NDArray[np.int64]
    resolution_m: float
    origin_xyyaw: se2.Array
    end_ns: int

    def at(self, xy_m: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """When points (..., 2) in the map frame were last confirmed and last contradicted, in ns.

        `NEVER` where the log does not tell, outside the lattice too.
        """
        points = np.atleast_2d(np.asarray(xy_m, dtype=np.float64))
        local = se2.transform_points(se2.inverse(self.origin_xyyaw), points)
        col, row = np.moveaxis(np.floor(local / self.resolution_m), -1, 0)
        height, width = self.confirmed_ns.shape
        inside = (row >= 0) & (row < height) & (col >= 0) & (col < width)
        cell = tuple(np.where(inside, index, 0).astype(np.int64) for index in (row, col))
        shape = np.shape(xy_m)[:-1]
        confirmed, contradicted = (
            np.where(inside, times[cell], NEVER).reshape(shape)
            for times in (self.confirmed_ns, self.contradicted_ns)
        )
        return confirmed, contradicted


def fresh_enough(
    freshness: Freshness, xy_m: ArrayLike, max_age_s: float, at_ns: int | None = None
) -> NDArray[np.bool_]:
    """(...) which points (..., 2) of a way, in the map frame, may be acted on.

    A point is fresh if the map was confirmed there no longer than `max_age_s` ago, and not
    contradicted since.

    Args:
        freshness: what the log saw.
        xy_m: points, m; space them no wider than the lattice to miss no cell.
        max_age_s: how old the confirmation may be.
        at_ns: when somebody wants to act, on the bundle's clock; the log's end if None.

    Raises:
        ValueError: `at_ns` lies before the log's end: what was known then is not kept.
    """
    at_ns = freshness.end_ns if at_ns is None else at_ns
    if at_ns < freshness.end_ns:
        raise ValueError("freshness is known from the log's end on")
    confirmed, contradicted = freshness.at(xy_m)
    # Whole ns: a float would round times of this age to a few hundred of them.
    is_recent = at_ns - confirmed <= round(max_age_s * 1e9)
    return np.asarray((confirmed != NEVER) & is_recent & (contradicted <= confirmed))
