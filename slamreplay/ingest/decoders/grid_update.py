"""map_msgs/OccupancyGridUpdate and nav2_msgs/CostmapUpdate: windows of a map or a costmap.

costmap_2d and nav2 publish the whole grid once, and again when its size or origin changes; what
changes in between comes as windows on the same topic's name with `_updates` behind it, counted in
cells of the last whole grid (costmap_2d_publisher.cpp).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.grid import cells_of_costs

SUFFIX = "_updates"


def _decode(messages: Messages, width: str, height: str, cells: Ragged) -> Decoded:
    grid_topic = np.full(len(messages), messages.topic.removesuffix(SUFFIX), dtype=object)
    columns: dict[str, Any] = {
        "frame_id": messages.frames(),
        "grid_topic": grid_topic,
        "x": messages.column("x", np.int64),
        "y": messages.column("y", np.int64),
        "width": messages.column(width, np.int64),
        "height": messages.column(height, np.int64),
        "cells": cells,
    }
    filled = (columns["width"] * columns["height"] == cells.lengths) & (cells.lengths > 0)
    odd = Remark("lost", int((~filled).sum()), "size and number of cells do not fit")
    return kept(filled, columns, messages.every, messages.stamps(), (odd,))


def _occupancy_grid_update(messages: Messages) -> Decoded:
    return _decode(messages, "width", "height", messages.ragged("data", np.int8))


def _costmap_update(messages: Messages) -> Decoded:
    return _decode(messages, "size_x", "size_y", cells_of_costs(messages))


OCCUPANCY_GRID_UPDATE = Decoder("costmap_updates", _occupancy_grid_update)
COSTMAP_UPDATE = Decoder("costmap_updates", _costmap_update)
