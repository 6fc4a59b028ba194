"""costmap_2d/VoxelGrid and nav2_msgs/VoxelGrid, seen from above: what a voxel layer has marked.

One number is one column of at most 16 voxels: its upper half has a bit for each that is marked, and
where upper and lower half differ a voxel is unknown (voxel_grid.h). The layer itself calls a column
an obstacle where any voxel of it is marked, by its defaults; costs around obstacles are not in it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.maps.grid import FREE, OCCUPIED, UNKNOWN

_HALF, _LOWER = 16, 0xFFFF


def _decode(messages: Messages) -> Decoded:
    columns_of = messages.ragged("data", np.uint64)
    levels = messages.column("size_z", np.int64)
    resolution = messages.columns("resolutions", "xy")
    origin = messages.columns("origin", "xy")
    width, height = messages.column("size_x", np.int64), messages.column("size_y", np.int64)
    filled = (width * height == columns_of.lengths) & (columns_of.lengths > 0)
    filled &= np.isfinite(origin).all(axis=1) & np.isfinite(resolution).all(axis=1)
    with np.errstate(invalid="ignore"):
        square = np.isclose(resolution[:, 0], resolution[:, 1]) & (resolution[:, 0] > 0.0)
    widest = np.zeros(len(messages), dtype=np.uint64)
    some = columns_of.lengths > 0
    starts = columns_of.offsets[:-1][some]
    widest[some] = np.maximum.reduceat(columns_of.values, starts) if len(starts) else 0
    known = (levels > 0) & (levels <= _HALF) & (widest < np.uint64(1) << np.uint64(2 * _HALF))
    columns: dict[str, Any] = {
        "frame_id": messages.frames(),
        "resolution_m": resolution[:, 0].astype(np.float32).astype(float),
        "width": width,
        "height": height,
        "origin_xyyaw": np.column_stack([origin, np.zeros(len(messages))]),
        "cells": _from_above(columns_of, levels),
    }
    remarks = (
        Remark("lost", int((~filled).sum()), "size, resolution and number of columns do not fit"),
        Remark("lost", int((filled & ~square).sum()), "voxels are not square"),
        Remark("lost", int((filled & square & ~known).sum()), "columns of more than 16 voxels"),
    )
    return kept(filled & square & known, columns, messages.every, messages.stamps(), remarks)


def _from_above(columns_of: Ragged, levels: np.ndarray) -> Ragged:
    """100 where any voxel is marked, -1 where none was ever seen, else 0."""
    bits = columns_of.values.astype(np.uint32)
    every = (np.uint32(1) << np.clip(levels, 0, _HALF).astype(np.uint32)) - np.uint32(1)
    used = np.repeat(every, columns_of.lengths)
    marked = (bits >> np.uint32(_HALF)) & used
    unknown = (marked ^ bits) & used & np.uint32(_LOWER)
    cells = np.where(marked != 0, OCCUPIED, np.where(unknown == used, UNKNOWN, FREE))
    return Ragged(cells.astype(np.int8), columns_of.offsets)


VOXEL_GRID = Decoder("costmaps", _decode)
