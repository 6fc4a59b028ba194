"""The occupancy grid and its version."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.errors import MapError
from slamreplay.geometry import se2

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
#: nav_msgs/OccupancyGrid gives per cent; from here on a cell counts as a wall, below as free.
OCCUPIED_FROM, FREE_TO = 65, 25


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A map layer: what is known to stand where.

    Attributes:
        cells: (H, W) int8, row 0 at the bottom: 0 free to 100 occupied, -1 unknown.
        resolution_m: edge of a cell.
        origin_xyyaw: (3,) pose of the lower left corner of cell (0, 0) in the map frame; its yaw
            turns the whole grid and is honoured everywhere.
        frame_id: the frame it is drawn in.
    """

    cells: NDArray[np.int8]
    resolution_m: float
    origin_xyyaw: se2.Array
    frame_id: str = "map"

    def __post_init__(self) -> None:
        if self.cells.ndim != 2 or 0 in self.cells.shape:
            raise MapError(f"a map needs height and width, this one has shape {self.cells.shape}")
        if not (np.isfinite(self.resolution_m) and self.resolution_m > 0):
            raise MapError(f"resolution is {self.resolution_m} m", hint="it must be positive")
        if not np.isfinite(self.origin_xyyaw).all():
            raise MapError(f"origin {self.origin_xyyaw.tolist()} is not finite")
        for array in (self.cells, self.origin_xyyaw):
            array.setflags(write=False)

    @cached_property
    def version(self) -> str:
        """`sha256:` and the hash of cells and metadata: two maps with one version are one map."""
        digest = hashlib.sha256(np.ascontiguousarray(self.cells).tobytes())
        meta = (self.cells.shape, self.resolution_m, self.origin_xyyaw.tolist(), self.frame_id)
        digest.update(repr(meta).encode())
        return f"sha256:{digest.hexdigest()}"

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """(H, W) cells that a beam ends on."""
        return self.cells >= OCCUPIED_FROM

    @cached_property
    def barred(self) -> NDArray[np.bool_]:
        """(H + 2, W + 2) occupied cells, in a frame of others that end a ray's way, too."""
        barred = np.ones((self.cells.shape[0] + 2, self.cells.shape[1] + 2), dtype=bool)
        barred[1:-1, 1:-1] = self.occupied
        barred.setflags(write=False)
        return barred

    @property
    def free(self) -> NDArray[np.bool_]:
        """(H, W) cells known to be empty."""
        return (self.cells >= 0) & (self.cells <= FREE_TO)

    def cell_of(self, xy_m: ArrayLike) -> NDArray[np.int64]:
        """(..., 2) row and column of points (..., 2) in the map frame; may lie outside."""
        local = se2.transform_points(se2.inverse(self.origin_xyyaw), np.atleast_2d(xy_m))
        index = np.floor(local / self.resolution_m).astype(np.int64)
        return index[..., ::-1].reshape(np.shape(xy_m))

    def centre_of(self, row_col: ArrayLike) -> se2.Array:
        """(..., 2) centres in the map frame of cells (..., 2) given as row and column."""
        index = np.atleast_2d(np.asarray(row_col, dtype=np.float64))
        local = (index[..., ::-1] + 0.5) * self.resolution_m
        return se2.transform_points(self.origin_xyyaw, local).reshape(np.shape(row_col))

    def inside(self, row_col: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(...) which cells (..., 2) exist."""
        row, col = row_col[..., 0], row_col[..., 1]
        height, width = self.cells.shape
        return (row >= 0) & (row < height) & (col >= 0) & (col < width)
