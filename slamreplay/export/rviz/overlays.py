"""Changed cells as grids to lay over the map.

Their values are those of costs, for RViz's colour scheme "costmap" shows them as they should be
(rviz_default_plugins, palette_builder.cpp): 0 is transparent, 99 cyan, 100 purple.
"""

from __future__ import annotations

import numpy as np
import yaml
from numpy.typing import NDArray

from slamreplay.bundle.products import Changes
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import FREE_THRESH, pgm

APPEARED, REMOVED = 100, 99


def overlays(grid: OccupancyGrid, changes: Changes | None) -> dict[str, OccupancyGrid]:
    """Name to overlay: what appeared, and what was removed; none where nothing was compared."""
    if changes is None:
        return {}
    marked = {"appeared": (changes.appeared, APPEARED), "removed": (changes.removed, REMOVED)}
    return {name: _overlay(grid, cells, value) for name, (cells, value) in marked.items()}


def overlay_files(overlay: OccupancyGrid, stem: str) -> dict[str, bytes]:
    """File name to content of a map_server pair in mode raw, whose pixels are the cells."""
    meta = {
        "image": f"{stem}.pgm",
        "mode": "raw",
        "resolution": overlay.resolution_m,
        "origin": overlay.origin_xyyaw.tolist(),
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": FREE_THRESH,
    }
    text = yaml.safe_dump(meta, sort_keys=False, default_flow_style=None)
    pixels = np.flipud(overlay.cells).astype(np.uint8)
    return {f"{stem}.yaml": text.encode(), f"{stem}.pgm": pgm(pixels)}


def _overlay(grid: OccupancyGrid, marked: NDArray[np.bool_], value: int) -> OccupancyGrid:
    cells = np.where(marked, value, 0).astype(np.int8)
    return OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)
