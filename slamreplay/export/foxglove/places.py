"""The map, what of it is not true, and where the robot stopped."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.KeyValuePair_pb2 import KeyValuePair
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray

from slamreplay.bundle.products import ChangedRegion
from slamreplay.evidence import colours
from slamreplay.evidence.clean import clean
from slamreplay.export.changed_cells import APPEARED, REMOVED, changed_cells
from slamreplay.export.foxglove import topics
from slamreplay.export.foxglove.parts import (
    Stream,
    colour,
    fields,
    line,
    pose,
    stamp,
    text,
    update,
)
from slamreplay.export.plane import box_corners
from slamreplay.export.shown import Shown
from slamreplay.geometry.se2 import Array
from slamreplay.maps.grid import OccupancyGrid

#: A cell of a grid: its colour, which viewers show as it is, and the value behind it.
_RGBA = [(name, "u1") for name in ("red", "green", "blue", "alpha")]
_MAP = np.dtype([*_RGBA, ("occupancy", "i1")])
_CHANGE = np.dtype([*_RGBA, ("change", "u1")])


def places(shown: Shown) -> Iterator[Stream]:
    """Streams of the map, of changed cells and regions, and of stops."""
    yield _maps(shown)
    yield _changed_cells(shown)
    yield _regions(shown)
    yield _stops(shown)


def _maps(shown: Shown) -> Stream:
    for t_ns, grid in shown.maps:
        cells = np.zeros(grid.cells.shape, dtype=_MAP)
        cells["occupancy"] = grid.cells
        _paint(cells, grid.free, colours.FREE)
        _paint(cells, grid.occupied, colours.WALL)
        between = ~(grid.free | grid.occupied) & (grid.cells >= 0)
        _paint(cells, between, colours.GREY)
        yield t_ns, topics.MAP, _grid(t_ns, shown, cells, grid, grid.origin_xyyaw, -0.03)


def _changed_cells(shown: Shown) -> Stream:
    for t_ns, change, corner in changed_cells(shown):
        assert shown.post.grid is not None
        cells = np.zeros(change.shape, dtype=_CHANGE)
        cells["change"] = change
        _paint(cells, change == APPEARED, colours.ORANGE)
        _paint(cells, change == REMOVED, colours.YELLOW)
        grid = _grid(t_ns, shown, cells, shown.post.grid, corner, -0.02)
        yield t_ns, topics.CHANGED_CELLS, grid


def _paint(cells: NDArray, where: NDArray[np.bool_], hexadecimal: str) -> None:
    for name, value in zip(("red", "green", "blue"), colours.rgb(hexadecimal), strict=True):
        cells[name][where] = value
    cells["alpha"][where] = 255


def _grid(
    t_ns: int, shown: Shown, cells: NDArray, of: OccupancyGrid, corner: Array, z_m: float
) -> Grid:
    return Grid(
        timestamp=stamp(t_ns),
        frame_id=shown.frame_id,
        pose=pose(corner, z_m),
        column_count=cells.shape[1],
        cell_size=Vector2(x=of.resolution_m, y=of.resolution_m),
        row_stride=cells.shape[1] * cells.itemsize,
        cell_stride=cells.itemsize,
        fields=fields(cells.dtype),
        data=cells.tobytes(),
    )


def _regions(shown: Shown) -> Stream:
    """Boxes around changed regions, all that have been seen so far in each message."""
    told: list[SceneEntity] = []
    for number, region in enumerate(shown.regions, start=1):
        t_ns = max(region.first_seen_ns, shown.place_ns)
        told.append(_region(region, f"region {number}", t_ns, shown.frame_id))
        yield t_ns, topics.CHANGED_REGIONS, update(*told)


def _region(region: ChangedRegion, name: str, t_ns: int, frame: str) -> SceneEntity:
    hexadecimal = colours.YELLOW if region.kind == "removed" else colours.ORANGE
    boxes = [region.bbox_m] if region.from_bbox_m is None else [region.bbox_m, region.from_bbox_m]
    lines = [line(box_corners(box), hexadecimal, width_px=1.5, is_loop=True) for box in boxes]
    if region.from_bbox_m is not None:
        ends = np.array([np.reshape(box, (2, 2)).mean(axis=0) for box in reversed(boxes)])
        lines.append(line(ends, hexadecimal, width_px=1.0))
    facts = {
        "kind": region.kind,
        "area_m2": f"{region.area_m2:.3f}",
        "views": str(region.views),
        "confidence": f"{region.confidence:.3f}",
        "first_seen_ns": str(region.first_seen_ns),
        "last_seen_ns": str(region.last_seen_ns),
    }
    return SceneEntity(
        timestamp=stamp(t_ns),
        frame_id=frame,
        id=name,
        metadata=[KeyValuePair(key=key, value=value) for key, value in facts.items()],
        lines=lines,
        texts=[text(region.kind, np.array(region.bbox_m[2:]), hexadecimal, size_px=12.0)],
    )


def _stops(shown: Shown) -> Stream:
    told: list[SceneEntity] = []
    for number, stop in shown.stops:
        at = np.array([stop.x_m, stop.y_m, 0.0], dtype=np.float64)
        hexadecimal = colours.STATES[stop.state]
        ball = SpherePrimitive(
            pose=pose(at), size=Vector3(x=0.3, y=0.3, z=0.05), color=colour(hexadecimal)
        )
        told.append(
            SceneEntity(
                timestamp=stamp(stop.t_ns),
                frame_id=shown.frame_id,
                id=f"stop {number}",
                metadata=[KeyValuePair(key="cause", value=clean(stop.cause))],
                spheres=[ball],
                texts=[text(f"stop {number}", at[:2], "#ffffff")],
            )
        )
        yield stop.t_ns, topics.STOPS, update(*told)
