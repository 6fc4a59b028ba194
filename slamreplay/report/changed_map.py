"""changed.pgm and changed.yaml: the cells that are not as the map says, on the map's own raster."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.products import Changes
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import PIXEL_FREE, PIXEL_OCCUPIED, PIXEL_UNKNOWN, map_files, pgm


def changed_files(grid: OccupancyGrid, changes: Changes | None) -> dict[str, bytes]:
    """File name to content; 0 appeared, 254 removed, 205 neither (or not known).

    A map_server pair: it loads as a map whose walls are what appeared.
    """
    pixels = np.full(grid.cells.shape, PIXEL_UNKNOWN, dtype=np.uint8)
    if changes is not None:
        pixels[changes.removed] = PIXEL_FREE
        pixels[changes.appeared] = PIXEL_OCCUPIED
    return {**map_files(grid, "changed"), "changed.pgm": pgm(np.flipud(pixels))}
