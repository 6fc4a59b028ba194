"""nav_msgs/OccupancyGrid (a map or a costmap, by its role) and nav2_msgs/Costmap."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se3
from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: Costs 0 to 255 as nav2_costmap_2d publishes them: 0 stays 0, 1-252 become 1-98, 253 (inscribed)
#: 99, 254 (lethal) 100, 255 unknown (costmap_2d_publisher.cpp).
COST_SCALE: NDArray[np.int8] = np.array(
    [0, *(1 + 97 * (cost - 1) // 251 for cost in range(1, 253)), 99, 100, -1], dtype=np.int8
)


def _decode(messages: Messages, meta: str, width: str, height: str, cells: Ragged) -> Decoded:
    position = messages.columns(f"{meta}.origin.position", "xyz")
    raw = messages.columns(f"{meta}.origin.orientation", "xyzw")
    unset = (raw == 0.0).all(axis=1)  # common in costmaps: nobody filled it in
    raw[unset] = (0.0, 0.0, 0.0, 1.0)
    orientation, keep, remarks = pose_rows(position, raw)
    columns: dict[str, Any] = {
        "frame_id": messages.frames(),
        "resolution_m": messages.column(f"{meta}.resolution").astype(np.float32).astype(float),
        "width": messages.column(f"{meta}.{width}", np.int64),
        "height": messages.column(f"{meta}.{height}", np.int64),
        "origin_xyyaw": np.column_stack([position[:, :2], se3.yaw_from_quaternion(orientation)]),
        "cells": cells,
    }
    filled = (columns["width"] * columns["height"] == cells.lengths) & (cells.lengths > 0)
    filled &= np.isfinite(columns["resolution_m"]) & (columns["resolution_m"] > 0.0)
    own = (
        Remark("repaired", int(unset.sum()), "origin without orientation taken as not turned"),
        Remark("lost", int((~filled).sum()), "size, resolution and number of cells do not fit"),
    )
    return kept(keep & filled, columns, messages.every, messages.stamps(), (*remarks, *own))


def _occupancy_grid(messages: Messages) -> Decoded:
    return _decode(messages, "info", "width", "height", messages.ragged("data", np.int8))


def cells_of_costs(messages: Messages) -> Ragged:
    """Costs of field `data` as 0 to 100 and -1; declared int8, their bytes are the same."""
    costs = messages.ragged("data", np.uint8)
    return Ragged(COST_SCALE[costs.values], costs.offsets)


def _costmap(messages: Messages) -> Decoded:
    return _decode(messages, "metadata", "size_x", "size_y", cells_of_costs(messages))


OCCUPANCY_GRID = Decoder("costmaps", _occupancy_grid)
COSTMAP = Decoder("costmaps", _costmap)
