"""The map layer from a map_server yaml."""

from __future__ import annotations

import hashlib
from pathlib import Path

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import read_map


def given_map(path: Path, frame_id: str) -> tuple[OccupancyGrid, list[Source], list[Loss]]:
    """The map behind a yaml, in the log's map frame, with the files it was read from.

    Raises:
        MapError: the yaml or its image cannot be read.
    """
    warnings: list[str] = []
    grid = read_map(path, warn=warnings.append)
    grid = OccupancyGrid(grid.cells, grid.resolution_m, grid.origin_xyyaw, frame_id)
    losses = [Loss(kind="repaired", what=path.name, count=1, reason=w) for w in warnings]
    content = path.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    source = Source(name=path.name, format="map_server", bytes=len(content), sha256=digest)
    return grid, [source], losses
