"""The map, what of it is not true, and where the robot stopped."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from slamreplay.evidence import colours
from slamreplay.export.changed_cells import APPEARED, REMOVED, changed_cells
from slamreplay.export.plane import box_corners
from slamreplay.export.rerun.batches import (
    closed,
    in_space,
    line_look,
    point_look,
    rgba,
    send_lines,
    send_points,
)
from slamreplay.export.rerun.sink import Sink
from slamreplay.export.shown import Shown
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.se3 import quaternion_from_yaw

#: Of what lies over the map. Below one: an opaque picture is black where it is transparent.
_OPACITY = 0.999


def draw_places(shown: Shown, sink: Sink) -> None:
    """Map, changed cells and regions, and stops."""
    for t_ns, grid in shown.maps:
        paint = np.full((*grid.cells.shape, 4), (*colours.rgb(colours.GROUND), 255), np.uint8)
        paint[grid.cells >= 0] = (*colours.rgb(colours.GREY), 255)
        paint[grid.free] = (*colours.rgb(colours.FREE), 255)
        paint[grid.occupied] = (*colours.rgb(colours.WALL), 255)
        _send_grid(sink, "map/grid", t_ns, paint, grid.resolution_m, grid.origin_xyyaw)
    for t_ns, change, corner in changed_cells(shown):
        assert shown.post.grid is not None
        paint = np.zeros((*change.shape, 4), dtype=np.uint8)
        paint[change == APPEARED] = (*colours.rgb(colours.ORANGE), 255)
        paint[change == REMOVED] = (*colours.rgb(colours.YELLOW), 255)
        _send_grid(sink, "map/changed", t_ns, paint, shown.post.grid.resolution_m, corner, over=1)
    _draw_regions(shown, sink)
    _draw_stops(shown, sink)


def _send_grid(
    sink: Sink,
    entity: str,
    t_ns: int,
    paint: NDArray[np.uint8],
    cell_m: float,
    corner: Array,
    *,
    over: int = 0,
) -> None:
    """Cells (H, W, 4), row 0 at the bottom; of a picture the first row is the uppermost.

    `corner` is the pose of the lower left corner, which Rerun asks for, too.
    """
    x, y, yaw = corner.tolist()
    form = rr.components.ImageFormat(
        width=paint.shape[1], height=paint.shape[0], color_model="RGBA", channel_datatype="U8"
    )
    columns = rr.GridMap.columns(
        data=[np.ascontiguousarray(paint[::-1]).ravel()],
        format=[form],
        cell_size=[cell_m],
        translation=[[x, y, -0.03 + 0.01 * over]],
        quaternion=quaternion_from_yaw([yaw]),
        opacity=[_OPACITY if over else 1.0],
        draw_order=[float(over)],
    )
    sink.send(entity, [t_ns], columns)


def _draw_regions(shown: Shown, sink: Sink) -> None:
    """Boxes around regions, at each time all that have been seen so far."""
    if not shown.regions:
        return
    boxes = [closed(box_corners(region.bbox_m)) for region in shown.regions]
    kinds = [region.kind for region in shown.regions]
    so_far = range(1, len(boxes) + 1)
    send_lines(
        sink,
        "map/changed/regions",
        [max(region.first_seen_ns, shown.place_ns) for region in shown.regions],
        [boxes[:k] for k in so_far],
        labels=[kinds[:k] for k in so_far],
    )
    sink.always("map/changed/regions", line_look(colours.ORANGE, 1.5))


def _draw_stops(shown: Shown, sink: Sink) -> None:
    if not shown.stops:
        return
    places = in_space(np.array([[stop.x_m, stop.y_m] for _, stop in shown.stops], dtype=np.float64))
    paint = np.array([rgba(colours.STATES[s.state]) for _, s in shown.stops], dtype=np.uint32)
    names = [f"stop {number}" for number, _ in shown.stops]
    so_far = range(1, len(names) + 1)
    send_points(
        sink,
        "map/stops",
        [stop.t_ns for _, stop in shown.stops],
        [places[:k] for k in so_far],
        colours=[paint[:k] for k in so_far],
        labels=[names[:k] for k in so_far],
    )
    sink.always("map/stops", point_look(6.0))
