"""Versions of the map that held before the newest one: beams are compared with that of their time.

The robot is placed in the newest version, and evidence over time is kept on its raster. Only what a
single beam says of the map is asked of the version that held when the beam was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.hindsight.beams import Beams
from slamreplay.hindsight.changed_beams import BEYOND_M, NEARER, BeamsOnMap, ends_in, on_map
from slamreplay.maps.grid import OCCUPIED_FROM, OccupancyGrid
from slamreplay.matching.field import WorkingMap

_BLOCK_CELLS = 500_000
#: So many versions before the newest come from a mapper that runs; nobody loads as many by hand.
#: What the first of several versions did not know, the log's own mapper has drawn in any case.
MAPPER_VERSIONS = 4


@dataclass(frozen=True, eq=False)
class Earlier:
    """A version that was followed by another one.

    Attributes:
        spans: times [start_ns, end_ns) over which it held.
        grid: reads it; many of them at once would fill the memory.
        is_first: no other version held before it.
    """

    spans: tuple[tuple[int, int], ...]
    grid: Callable[[], OccupancyGrid | None]
    is_first: bool = False

    def rows(self, t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Indices of the times (N,) at which it held."""
        held = np.zeros(len(t_ns), dtype=bool)
        for start_ns, end_ns in self.spans:
            held |= (t_ns >= start_ns) & (t_ns < end_ns)
        return np.flatnonzero(held)


def earlier_versions(view: BundleView) -> tuple[Earlier, ...]:
    """The versions before the newest one of a view of one place, by their first moment."""
    course = view.map_stretches[-1].held if view.map_stretches else ()
    spans: dict[str, list[tuple[int, int]]] = {}
    for held in course:
        spans.setdefault(held.version, []).append((held.start_ns, held.end_ns))
    first, newest = (course[k].version if course else "" for k in (0, -1))
    return tuple(
        Earlier(tuple(when), partial(view.grid_of, version), version == first)
        for version, when in spans.items()
        if version != newest
    )


def on_raster(grid: OccupancyGrid, working: WorkingMap) -> WorkingMap:
    """Another version on the raster of a working map; what it lacks there is unknown.

    A cell is a wall if any wall cell of the version has its centre in it, or it has its own centre
    in one; likewise it is known.
    """
    walls = np.zeros(working.walls.shape, dtype=bool)
    known = np.zeros(working.walls.shape, dtype=bool)
    for rows in _blocks(walls):
        index = np.argwhere(np.ones_like(walls[rows])) + np.array([rows.start, 0])
        centres = working.corner_xy + (index[:, ::-1] + 0.5) * working.resolution_m
        cell = grid.cell_of(se2.transform_points(working.origin_xyyaw, centres))
        inside = grid.inside(cell)
        at, values = tuple(index[inside].T), grid.cells[tuple(cell[inside].T)]
        walls[at], known[at] = values >= OCCUPIED_FROM, values >= 0
    from_map = se2.inverse(working.origin_xyyaw)
    for rows in _blocks(grid.cells):
        part = grid.cells[rows]
        for mask, out in ((part >= OCCUPIED_FROM, walls), (part >= 0, known)):
            own = np.argwhere(mask) + np.array([rows.start, 0])
            own_xy = se2.transform_points(from_map, grid.centre_of(own))
            index = np.floor((own_xy - working.corner_xy) / working.resolution_m).astype(np.int64)
            index = index[:, ::-1]
            index = index[((index >= 0) & (index < walls.shape)).all(axis=1)]
            out[tuple(index.T)] = True
    return replace(working, walls=walls, unknown=~known)


def _blocks(cells: NDArray) -> Iterator[slice]:
    """Rows of a grid, so many at a time that lists of their cells stay small."""
    step = max(1, _BLOCK_CELLS // cells.shape[1])
    for first in range(0, cells.shape[0], step):
        yield slice(first, min(first + step, cells.shape[0]))


@dataclass(frozen=True, eq=False)
class LaidOver:
    """Beams over the map of their time.

    Attributes:
        beams: what each says.
        near: (N, B) beams that end before their wall, but so near to another that it explains them.
        drawn: the newest map with the walls of every version.
        own_free: (H, W) cells that were called free, if at all, by the log's own mapper.
        own_wall: (H, W) cells that were called a wall, if at all, by the log's own mapper.
        at_wall: (N, B) hits that end at a mapped wall, whatever they passed before.
    """

    beams: BeamsOnMap
    near: NDArray[np.bool_]
    drawn: WorkingMap
    own_free: NDArray[np.bool_]
    own_wall: NDArray[np.bool_]
    at_wall: NDArray[np.bool_]


def laid_over(
    working: WorkingMap, earlier: Sequence[Earlier], beams: Beams, poses: se2.Array
) -> LaidOver:
    """Every beam laid over the version that held when it was measured.

    Args:
        working: the newest version.
        earlier: those before it.
        beams: the scans.
        poses: (N, 3) of the base in the grid's frame; NaN rows stay silent.
    """
    laid = on_map(working, beams, poses)
    about, walls = near_walls(working), working.walls
    near, at_wall = _near_a_wall(about, laid), ends_in(about, working, beams, poses)
    own_free = own_wall = np.zeros_like(walls)
    for version in earlier:
        rows = version.rows(beams.t_ns)
        grid = version.grid() if len(rows) else None
        if grid is None:
            continue
        old = on_raster(grid, working)
        of_old, about = beams.take(rows), near_walls(old)
        part = on_map(old, of_old, poses[rows])
        near[rows] = _near_a_wall(about, part)
        at_wall[rows] = ends_in(about, old, of_old, poses[rows])
        laid.says[rows], laid.where[rows] = part.says, part.where
        laid.is_sure[rows], laid.wall_m[rows] = part.is_sure, part.wall_m
        walls = walls | old.walls
        if version.is_first and len(earlier) >= MAPPER_VERSIONS:
            own_free, own_wall = old.unknown | old.walls, ~old.walls
        elif version.is_first:
            own_free = own_wall = old.unknown
    return LaidOver(laid, near, replace(working, walls=walls), own_free, own_wall, at_wall)


def _near_a_wall(near: NDArray[np.bool_], laid: BeamsOnMap) -> NDArray[np.bool_]:
    return (laid.says == NEARER) & near.ravel()[laid.where]


def near_walls(working: WorkingMap) -> NDArray[np.bool_]:
    """(H, W) cells so near to a wall that it explains what ends there."""
    if not working.walls.any():  # a mapper's first map may have none
        return np.zeros_like(working.walls)
    apart_m = distance_transform_edt(~working.walls) * working.resolution_m
    return np.asarray(apart_m <= BEYOND_M)
