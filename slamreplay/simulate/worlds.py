"""Places to drive in, as polygons: what the map was drawn from, and what stands there today.

Every place is irregular on purpose: racks differ in length, pillars and buttresses stand at uneven
distances, so that a few metres of scans fit one pose only.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from slamreplay.geometry import se2
from slamreplay.maps.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

MAP_RESOLUTION_M = 0.05
#: What beams really meet is drawn finer than the map, so that walls do not sit on map cells.
TRUE_RESOLUTION_M = 0.025
_WALL_M = 0.2
_SHELL_M = 0.15  # a mapper sees the faces of a rack, not what is inside it


@dataclass(frozen=True)
class Solid:
    """Something that stands: a name and the corners (K, 2) of a convex outline, in metres."""

    name: str
    corners: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class World:
    """Solids inside a rectangle (x_min, y_min, x_max, y_max); what lies outside is not mapped."""

    bounds: tuple[float, float, float, float]
    solids: tuple[Solid, ...]

    def changed(self, *, without: Iterable[str] = (), added: Iterable[Solid] = ()) -> World:
        """The same place after solids were taken away and others were put down."""
        gone = set(without)
        kept = tuple(s for s in self.solids if s.name not in gone)
        return replace(self, solids=(*kept, *added))


def box(name: str, x: float, y: float, width: float, depth: float, yaw: float = 0.0) -> Solid:
    """A rectangle with its lower left corner at (x, y), turned by `yaw` rad about its centre."""
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array([width, depth]) / 2.0
    pose = np.array([x + width / 2.0, y + depth / 2.0, yaw])
    return Solid(name, tuple((float(a), float(b)) for a, b in se2.transform_points(pose, half)))


def disc(name: str, x: float, y: float, radius: float) -> Solid:
    """A round pillar as a regular polygon of 16 corners."""
    angle = np.arange(16) * (np.pi / 8.0)
    xs, ys = x + radius * np.cos(angle), y + radius * np.sin(angle)
    return Solid(name, tuple((float(a), float(b)) for a, b in zip(xs, ys, strict=True)))


def rasterise(world: World, resolution_m: float, *, as_map: bool) -> OccupancyGrid:
    """The world as cells: occupied where the centre of a cell lies in a solid.

    Args:
        world: what stands where.
        resolution_m: edge of a cell.
        as_map: leave unknown what a mapper cannot have seen: outside, and inside solids.
    """
    margin = 0.6
    x0, y0 = world.bounds[0] - margin, world.bounds[1] - margin
    width = round((world.bounds[2] + margin - x0) / resolution_m)
    height = round((world.bounds[3] + margin - y0) / resolution_m)
    xs = x0 + (np.arange(width) + 0.5) * resolution_m
    ys = y0 + (np.arange(height) + 0.5) * resolution_m
    solid = np.zeros((height, width), dtype=bool)
    for item in world.solids:
        corners = np.array(item.corners)
        low, high = corners.min(axis=0), corners.max(axis=0)
        rows = slice(*np.searchsorted(ys, [low[1], high[1]]))
        cols = slice(*np.searchsorted(xs, [low[0], high[0]]))
        inside = np.ones((rows.stop - rows.start, cols.stop - cols.start), dtype=bool)
        for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            inside &= (bx - ax) * (ys[rows, None] - ay) >= (by - ay) * (xs[None, cols] - ax)
        solid[rows, cols] |= inside
    cells = np.where(solid, OCCUPIED, FREE).astype(np.int8)
    if as_map:
        from scipy.ndimage import binary_dilation

        in_bounds = ((ys >= world.bounds[1]) & (ys <= world.bounds[3]))[:, None] & (
            (xs >= world.bounds[0]) & (xs <= world.bounds[2])
        )[None, :]
        seen = binary_dilation(~solid & in_bounds, iterations=round(_SHELL_M / resolution_m))
        cells[~seen] = UNKNOWN
    return OccupancyGrid(cells, resolution_m, np.array([x0, y0, 0.0]))


def redrawn(grid: OccupancyGrid, xyyaw_to_from: se2.Array) -> OccupancyGrid:
    """A map drawn again in another frame, its rows along that frame's x axis.

    Args:
        grid: the map.
        xyyaw_to_from: (3,) the map's own frame in the new one.
    """
    height, width = grid.cells.shape
    corners = grid.centre_of(np.array([[0, 0], [0, width], [height, 0], [height, width]]))
    corners = se2.transform_points(xyyaw_to_from, corners)
    low = np.floor(corners.min(axis=0) / grid.resolution_m) * grid.resolution_m
    shape = np.ceil((corners.max(axis=0) - low) / grid.resolution_m).astype(np.int64)[::-1]
    new = OccupancyGrid(np.full(shape, UNKNOWN, np.int8), grid.resolution_m, np.array([*low, 0.0]))
    centres = new.centre_of(np.indices(shape).reshape(2, -1).T)
    old = grid.cell_of(se2.transform_points(se2.inverse(xyyaw_to_from), centres))
    inside = grid.inside(old)
    cells = np.full(len(old), UNKNOWN, dtype=np.int8)
    cells[inside] = grid.cells[old[inside, 0], old[inside, 1]]
    return OccupancyGrid(cells.reshape(shape), grid.resolution_m, new.origin_xyyaw)


def room_walls(name: str, bounds: tuple[float, float, float, float]) -> tuple[Solid, ...]:
    """Four walls around a rectangle, outside of it."""
    x0, y0, x1, y1 = bounds
    t = _WALL_M
    return (
        box(f"{name} south", x0 - t, y0 - t, x1 - x0 + 2 * t, t),
        box(f"{name} north", x0 - t, y1, x1 - x0 + 2 * t, t),
        box(f"{name} west", x0 - t, y0, t, y1 - y0),
        box(f"{name} east", x1, y0, t, y1 - y0),
    )


def warehouse() -> World:
    """A hall of 24 m x 14 m with six racks in three rows, pillars and a packing corner."""
    bounds = (0.0, 0.0, 24.0, 14.0)
    return World(
        bounds,
        (
            *room_walls("wall", bounds),
            box("rack a1", 3.0, 2.4, 5.6, 1.0),
            box("rack a2", 9.9, 2.4, 2.9, 1.0),
            box("rack b1", 4.4, 5.8, 3.4, 1.0),
            box("rack b2", 9.2, 5.8, 5.4, 1.0),
            box("rack c1", 2.6, 9.2, 4.4, 1.0),
            box("rack c2", 8.3, 9.2, 2.2, 1.0),
            box("rack c3", 11.6, 9.2, 2.5, 1.0),
            box("pillar 1", 16.6, 3.6, 0.4, 0.4),
            box("pillar 2", 17.4, 9.9, 0.4, 0.4),
            disc("pillar 3", 20.6, 6.9, 0.25),
            box("buttress 1", 0.9, 0.0, 0.5, 0.35),
            box("buttress 2", 5.7, 0.0, 0.3, 0.3),
            box("buttress 3", 11.2, 0.0, 0.8, 0.35),
            box("buttress 4", 4.9, 13.7, 0.4, 0.3),
            box("buttress 5", 8.7, 13.6, 0.9, 0.4),
            box("buttress 6", 14.3, 13.7, 0.3, 0.3),
            box("buttress 7", 0.0, 8.1, 0.3, 0.6),
            box("buttress 8", 0.0, 3.9, 0.25, 0.3),
            box("bench", 18.6, 1.3, 2.2, 0.8, 0.35),
            box("press", 21.6, 3.9, 1.3, 1.7, -0.2),
            box("office south", 18.6, 11.0, 5.4, 0.2),
            box("office west", 18.6, 11.2, 0.2, 1.3),
            box("charger", 0.0, 11.9, 0.5, 0.7),
        ),
    )


def drive_hall() -> World:
    """A hall of 13 x 10 m whose floor is left to drive units; shelves stand along its wall."""
    bounds = (0.0, 0.0, 13.0, 10.5)
    return World(
        bounds,
        (
            *room_walls("hall", bounds),
            box("shelf", 1.5, 0.0, 3.0, 0.3),
            box("desk", 12.5, 6.0, 0.5, 1.5),
        ),
    )


def office() -> World:
    """A ring of corridors, 2 m wide, around a block of rooms; 100 m along its middle line."""
    bounds = (0.0, 0.0, 35.95, 18.2)
    w, t = 2.0, 0.15  # corridor, inner walls
    x0, y0, x1, y1 = bounds[0] + w, bounds[1] + w, bounds[2] - w, bounds[3] - w
    solids = list(room_walls("wall", bounds))
    # Doors of the inner block stand open where there is a gap between two pieces of wall.
    south = ((x0, 6.3), (7.3, 12.9), (14.0, 22.4), (23.4, 25.9), (27.1, x1))
    north = ((x0, 4.1), (5.2, 10.6), (11.5, 18.9), (20.2, 29.3), (30.3, x1))
    west = ((y0, 4.9), (5.9, 12.2), (13.1, y1))
    east = ((y0, 8.0), (9.2, 14.1), (15.0, y1))
    solids += [box(f"inner south {i}", a, y0, b - a, t) for i, (a, b) in enumerate(south)]
    solids += [box(f"inner north {i}", a, y1 - t, b - a, t) for i, (a, b) in enumerate(north)]
    solids += [box(f"inner west {i}", x0, a, t, b - a) for i, (a, b) in enumerate(west)]
    solids += [box(f"inner east {i}", x1 - t, a, t, b - a) for i, (a, b) in enumerate(east)]
    solids += [box(f"cross {x}", x, y0 + t, t, y1 - y0 - 2 * t) for x in (8.8, 16.1, 26.4, 31.0)]
    solids += [box(f"middle {x}", x, y, d, t) for x, y, d in ((2.2, 9.6, 6.6), (16.3, 8.1, 10.1))]
    solids += [
        box(f"furniture {i}", *item)
        for i, item in enumerate(
            (
                (3.1, 0.0, 0.9, 0.4),
                (9.7, 0.0, 0.45, 0.35),
                (12.3, 1.75, 0.5, 0.25),
                (17.5, 0.0, 1.6, 0.45),
                (24.6, 0.0, 0.4, 0.3),
                (29.8, 0.0, 0.8, 0.4),
                (35.55, 4.2, 0.4, 1.1),
                (35.65, 7.9, 0.3, 0.5),
                (35.5, 12.6, 0.45, 0.7),
                (33.2, 17.8, 0.6, 0.4),
                (26.1, 17.85, 1.8, 0.35),
                (21.7, 17.8, 0.4, 0.4),
                (15.4, 16.2, 0.7, 0.25),
                (13.3, 17.75, 0.9, 0.45),
                (6.9, 17.9, 0.4, 0.3),
                (0.0, 14.1, 0.4, 0.5),
                (0.0, 10.7, 0.35, 1.3),
                (0.0, 6.4, 0.4, 0.4),
                (4.5, 4.2, 1.6, 0.8, 0.3),
                (11.0, 5.1, 1.4, 0.7, -0.4),
                (12.2, 12.4, 0.8, 1.6),
                (19.5, 4.0, 2.2, 0.9, 0.2),
                (22.1, 12.0, 1.0, 1.8, 0.5),
                (28.0, 5.0, 0.8, 1.6),
                (32.2, 9.8, 1.0, 1.4, 0.2),
                (4.0, 12.6, 1.2, 0.7),
            )
        )
    ]
    return World(bounds, tuple(solids))
