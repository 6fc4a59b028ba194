"""The map layer: from a map_server yaml, or from the OccupancyGrids of the log."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import MapError
from slamreplay.ingest.rows import TopicRows
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import read_map

#: A mapping run publishes its map every few seconds; the newest versions are what was driven on.
MAX_VERSIONS = 20


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


def recorded_maps(topic: TopicRows) -> tuple[list[OccupancyGrid], list[str], list[Loss]]:
    """Maps of a topic's rows, oldest first, and for each row the version that held from then on.

    Rows must be in the order of time. A row whose map makes no sense, or whose version is not
    among the newest `MAX_VERSIONS`, has the version "".
    """
    found: dict[str, OccupancyGrid] = {}
    versions: list[str] = []
    odd: list[str] = []
    for row in range(len(topic)):
        height, width = topic.columns["height"][row], topic.columns["width"][row]
        # ROS sends the resolution as float32: 0.05 arrives as 0.0500000007.
        resolution = float(str(np.float32(topic.columns["resolution_m"][row])))
        cells = topic.columns["cells"][row].reshape(height, width)
        origin = np.array(topic.columns["origin_xyyaw"][row])
        try:
            grid = OccupancyGrid(cells.copy(), resolution, origin, topic.columns["frame_id"][row])
        except MapError as error:
            odd.append(str(error))
            versions.append("")
            continue
        found.pop(grid.version, None)  # a version that comes back is the newest again
        found[grid.version] = grid
        versions.append(grid.version)
    kept = dict(list(found.items())[-MAX_VERSIONS:])
    losses = []
    if odd:
        losses.append(Loss(kind="lost", what=topic.topic, count=len(odd), reason=odd[0]))
    if len(found) > len(kept):
        reason = f"map versions before the newest {MAX_VERSIONS}"
        count = len(found) - len(kept)
        losses.append(Loss(kind="skipped", what=topic.topic, count=count, reason=reason))
    return list(kept.values()), [v if v in kept else "" for v in versions], losses


def map_rows(topic: TopicRows, versions: list[str]) -> TopicRows:
    """Rows of table `map_updates` for a topic's maps."""
    index = np.flatnonzero(np.array([bool(v) for v in versions], dtype=bool))
    rows = topic.take(index)
    columns = {
        "map_version": np.array(versions, dtype=object)[index],
        "frame_id": rows.columns["frame_id"],
    }
    return TopicRows(
        rows.topic, rows.type, rows.messages, "map_updates", columns, rows.t_sensor_ns,
        rows.t_log_ns,
    )  # fmt: skip
