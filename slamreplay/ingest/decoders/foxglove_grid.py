"""foxglove.Grid as an occupancy grid (a map or a costmap, by its role).

The schema says how numbers are packed into cells, not what they mean. Which field is taken:

1. the first that is called an occupancy or a cost (the viewer takes the first as well);
2. else the only one, where it is one byte and the topic is called a map, grid or costmap;
3. else red, green and blue, for converters also paint maps, in shades of grey.

And what its numbers mean:

- signed bytes and wider integers: nav_msgs/OccupancyGrid, -1 unknown, 0 to 100;
- unsigned bytes up to 100, and 255: the same numbers without their sign, 255 unknown;
- unsigned bytes in a field called a cost, or with numbers between 100 and 255: costs as
  nav2_costmap_2d has them, 254 lethal, 255 unknown;
- floats: a share from 0 to 1, per cent where any is above 1; not a number and negative: unknown;
- integers of an occupancy that are never above 1: shares too, 1 occupied;
- colours: pixels as map_server reads them, black occupied; transparent and coloured: unknown.

Source: docs.foxglove.dev, schemas, Grid; foxglove/studio, FoxgloveGrid.ts and colors.ts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se3
from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.foxglove import turned
from slamreplay.ingest.decoders.grid import COST_SCALE
from slamreplay.ingest.decoders.packed import PackedField, packed_fields, unpacked
from slamreplay.ingest.names import tokens
from slamreplay.maps.grid import FREE, OCCUPIED, UNKNOWN
from slamreplay.maps.map_server import FREE_THRESH

_OCCUPANCY = frozenset({"occupancy", "occupied", "occ", "probability", "obstacle", "obstacles",
                        "map", "grid", "cell", "cells", "data", "value", "values"})  # fmt: skip
_COST = frozenset({"cost", "costs", "costmap"})
_COLOURS = ("red", "green", "blue")
#: map_server's default; colours whose channels differ by more are no shade of grey (rviz paints
#: what is unknown in one whose channels differ by 25).
_OCCUPIED_THRESH, _GREY = 0.65, 32
#: Edges of a cell along x and y that are equal but for rounding.
_SQUARE = 1e-6


@dataclass(frozen=True, eq=False)
class _Layer:
    """The numbers of one grid, (H, W) or (H, W, 4) red green blue alpha, and what they are."""

    values: NDArray[Any]
    is_cost: bool


def _decode(messages: Messages) -> Decoded:
    size = messages.columns("cell_size", "xy")
    widths = messages.column("column_count", np.int64)
    strides = np.column_stack(
        [messages.column(f"{name}_stride", np.int64) for name in ("row", "cell")]
    ).reshape(-1, 2)
    data, fields = messages.ragged("data", np.uint8), packed_fields(messages)
    named = bool({"map", "grid", "costmap"} & set(tokens(messages.topic)))
    chosen = [_chosen(of_grid, named=named) for of_grid in fields]
    meant = np.array([bool(taken) for taken in chosen], dtype=bool)
    layers = [
        _layer(data[row], taken, int(widths[row]), *strides[row].tolist())
        for row, taken in enumerate(chosen)
    ]
    cells = _cells(layers)
    position = messages.columns("pose.position", "xyz")
    raw, unset = turned(messages, "pose.orientation")
    orientation, keep, remarks = pose_rows(position, raw)
    with np.errstate(invalid="ignore", over="ignore"):
        resolution = size[:, 0].astype(np.float32).astype(float)  # as ROS sends it
        square = np.abs(size[:, 0] - size[:, 1]) <= _SQUARE * np.abs(size[:, 0])
    sized = np.isfinite(resolution) & (resolution > 0.0)
    columns: dict[str, Any] = {
        "frame_id": messages.frames("frame_id"),
        "resolution_m": resolution,
        "width": widths,
        "height": np.array([0 if c is None else len(c) for c in cells], dtype=np.int64),
        "origin_xyyaw": np.column_stack([position[:, :2], se3.yaw_from_quaternion(orientation)]),
        "cells": Ragged.of((() if c is None else c.ravel() for c in cells), np.int8),
    }
    filled = np.array([c is not None for c in cells], dtype=bool)
    own = [Remark("repaired", unset, "origin without orientation taken as not turned")]
    for kind, sound, reason in (
        ("skipped", meant, "none of its fields is an occupancy or a cost"),
        ("lost", filled, "strides, columns and number of bytes do not fit"),
        ("lost", sized, "cell size is not positive"),
        ("lost", square, "cells are not square"),
    ):
        own.append(Remark(kind, int((keep & ~sound).sum()), reason))  # type: ignore[arg-type]
        keep &= sound
    stamps = messages.stamps("timestamp")
    return kept(keep, columns, messages.every, stamps, (*remarks, *own))


def _chosen(fields: list[PackedField], *, named: bool) -> list[PackedField]:
    """The field that holds the grid, or those of its colours; none where nothing does."""
    for field in fields:
        if (_OCCUPANCY | _COST) & set(tokens(field.name)):
            return [field]
    colours = {field.name: field for field in fields}
    if set(_COLOURS) <= set(colours):
        return [colours[name] for name in (*_COLOURS, "alpha") if name in colours]
    only = fields[0] if len(fields) == 1 else None
    is_byte = only is not None and only.dtype is not None and only.dtype.itemsize == 1
    return fields if named and is_byte else []


def _layer(
    data: NDArray[np.uint8],
    chosen: list[PackedField],
    width: int,
    row_stride: int,
    cell_stride: int,
) -> _Layer | None:
    """The chosen fields of all cells, None where the bytes do not hold them."""
    if not chosen or min(width, cell_stride) <= 0 or width * cell_stride > row_stride:
        return None
    height, rest = divmod(len(data), row_stride)
    height += rest >= width * cell_stride  # the last row may come without its padding
    if height == 0 or 0 < rest < width * cell_stride:
        return None
    shape, strides = (height, width), (row_stride, cell_stride)
    layers = [unpacked(data, field, shape, strides) for field in chosen]
    whole = [layer for layer in layers if layer is not None]
    if len(whole) < len(layers):
        return None
    if len(whole) == 1:
        return _Layer(whole[0], bool(_COST & set(tokens(chosen[0].name))))
    if len(whole) == len(_COLOURS):
        whole.append(np.full(shape, 255, dtype=whole[0].dtype))
    return _Layer(np.stack(whole, axis=-1), is_cost=False)


def _cells(layers: list[_Layer | None]) -> list[NDArray[np.int8] | None]:
    """(H, W) int8 of each grid, -1 unknown, 0 to 100; what numbers mean, all grids say together."""
    largest = max((_largest(layer) for layer in layers if layer is not None), default=0)
    found: list[NDArray[np.int8] | None] = []
    for layer in layers:
        if layer is None:
            found.append(None)
        elif layer.values.ndim > 2:
            found.append(_from_colours(layer.values))
        elif layer.values.dtype == np.uint8 and (layer.is_cost or largest > OCCUPIED):
            found.append(COST_SCALE[layer.values])
        else:
            scale = OCCUPIED if largest == 1 and not layer.is_cost else 1
            found.append(_from_occupancy(layer.values, scale))
    return found


def _largest(layer: _Layer) -> int:
    """The largest number of an integer layer, without unsigned bytes' 255; 0 for others."""
    if layer.values.ndim > 2 or layer.values.dtype.kind == "f" or layer.is_cost:
        return 0
    values = layer.values[layer.values != 255] if layer.values.dtype == np.uint8 else layer.values
    return int(values.max(initial=0))


def _from_occupancy(values: NDArray[Any], scale: int) -> NDArray[np.int8]:
    if values.dtype.itemsize == 1 and scale == 1:
        return values.view(np.int8)
    is_share = values.dtype.kind == "f" and not (values > 1.0).any()
    shares = values.view(np.int8) if values.dtype.itemsize == 1 else values
    with np.errstate(over="ignore"):
        per_cent = shares.astype(np.float64) * (OCCUPIED if is_share else scale)
    known = (per_cent >= FREE) & (per_cent <= OCCUPIED)
    return np.where(known, np.rint(np.where(known, per_cent, 0.0)), UNKNOWN).astype(np.int8)


def _from_colours(values: NDArray[Any]) -> NDArray[np.int8]:
    rgba = values.astype(np.float64) * (255.0 if values.dtype.kind == "f" else 1.0)
    colours = rgba[..., :3]
    p = (255.0 - colours.mean(axis=-1)) / 255.0
    known = (np.ptp(colours, axis=-1) <= _GREY) & (rgba[..., 3] > 0.0)
    cells = np.where(p >= _OCCUPIED_THRESH, OCCUPIED, np.where(p <= FREE_THRESH, FREE, UNKNOWN))
    return np.where(known, cells, UNKNOWN).astype(np.int8)


GRID = Decoder("costmaps", _decode)
