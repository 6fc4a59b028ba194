"""Ways through a place that keep clear of what stands there: goals drawn at random, then driven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from slamreplay.geometry import se2
from slamreplay.simulate.worlds import World, rasterise

#: A way's middle line keeps this far from everything: pure pursuit cuts corners by 0.25 m.
CLEARANCE_M = 0.62
_LARGE_M = 50.0

XY = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Floor:
    """Where a robot can go.

    Attributes:
        clearance: (H, W) distance to the nearest thing, m.
        cell_m: edge of a cell.
        corner: (2,) of cell (0, 0), m.
    """

    clearance: se2.Array
    cell_m: float
    corner: se2.Array

    @classmethod
    def of(cls, *worlds: World) -> Floor:
        """What is clear in all of these worlds (of the same bounds)."""
        cell = 0.1 if worlds[0].bounds[2] - worlds[0].bounds[0] < _LARGE_M else 0.2
        grids = [rasterise(w, cell, as_map=False) for w in worlds]
        x0, y0, x1, y1 = worlds[0].bounds
        solid = grids[0].occupied.copy()
        for grid in grids[1:]:
            solid |= grid.occupied
        corner = grids[0].origin_xyyaw[:2]
        height, width = solid.shape
        xs = corner[0] + (np.arange(width) + 0.5) * cell
        ys = corner[1] + (np.arange(height) + 0.5) * cell
        solid |= ~(((xs > x0) & (xs < x1))[None, :] & ((ys > y0) & (ys < y1))[:, None])
        return cls(distance_transform_edt(~solid, sampling=cell), cell, corner)

    def at(self, xy: se2.Array) -> se2.Array:
        """(N,) clearance of points (N, 2); 0 outside."""
        cells = np.floor((np.atleast_2d(xy) - self.corner) / self.cell_m).astype(np.int64)
        height, width = self.clearance.shape
        col, row = cells.T
        inside = (col >= 0) & (row >= 0) & (col < width) & (row < height)
        cells = np.where(inside[:, None], cells, 0)
        return np.where(inside, self.clearance[cells[:, 1], cells[:, 0]], 0.0)

    def random_place(self, rng: np.random.Generator, clear_m: float = CLEARANCE_M) -> XY:
        """Somewhere with that much room, in the largest connected part."""
        from scipy.ndimage import label

        parts, _ = label(self.clearance >= clear_m)
        cells = np.argwhere(parts == 1 + np.argmax(np.bincount(parts.ravel())[1:]))
        row, col = cells[rng.integers(len(cells))]
        return self._centre(row, col)

    def ways(self, start: XY) -> Ways:
        """Shortest ways from a place to all others."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import dijkstra

        free = self.clearance >= CLEARANCE_M
        index = np.full(free.shape, -1)
        index[free] = np.arange(free.sum())
        # A way along the middle of an aisle is a little shorter than one along its racks.
        cost = 1.0 + 0.6 * np.clip(1.3 - self.clearance, 0.0, 1.0)
        rows, cols, weights = [], [], []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            a, b = _shifted(index, dy, dx)
            both = (a >= 0) & (b >= 0)
            ca, cb = _shifted(cost, dy, dx)
            rows.append(a[both])
            cols.append(b[both])
            weights.append((0.5 * np.hypot(dy, dx) * self.cell_m * (ca + cb))[both])
        n = int(free.sum())
        graph = coo_array(
            (np.concatenate(weights), (np.concatenate(rows), np.concatenate(cols))), shape=(n, n)
        ).tocsr()
        cells = np.argwhere(free)
        centres = self.corner + (cells[:, ::-1] + 0.5) * self.cell_m
        source = int(np.argmin(np.hypot(*(centres - np.array(start)).T)))
        far, before = dijkstra(graph, directed=False, indices=source, return_predecessors=True)
        return Ways(self, centres, far, before)

    def sees(self, a: se2.Array, b: se2.Array) -> bool:
        """Whether the straight way from a to b is clear all along."""
        n = max(int(np.hypot(*(b - a)) / (0.5 * self.cell_m)), 2)
        points = a + np.linspace(0.0, 1.0, n)[:, None] * (b - a)
        return bool((self.at(points) >= CLEARANCE_M).all())

    def _centre(self, row: int, col: int) -> XY:
        x, y = self.corner + (np.array([col, row]) + 0.5) * self.cell_m
        return float(x), float(y)


@dataclass(frozen=True, eq=False)
class Ways:
    """Every way from one place: `centres` (N, 2), `length` (N,), `before` (N,) the cell before."""

    floor: Floor
    centres: se2.Array
    length: se2.Array
    before: NDArray[np.int32]

    def within(self, low_m: float, high_m: float) -> NDArray[np.int64]:
        """Places that are that far; the farthest ones of all if none is."""
        reached = np.where(np.isfinite(self.length), self.length, -1.0)
        found = np.flatnonzero((reached >= low_m) & (reached <= high_m))
        return found if len(found) else np.flatnonzero(reached >= 0.9 * reached.max())

    def to(self, place: int) -> tuple[XY, ...]:
        """The corners of the way to a place, start left out."""
        cells = [place]
        while self.before[cells[-1]] >= 0:
            cells.append(int(self.before[cells[-1]]))
        points = self.centres[cells[::-1]]
        corners, at = [], 0
        while at < len(points) - 1:
            low, high = at + 1, at + 1
            while high < len(points) and self.floor.sees(points[at], points[high]):
                low, high = (
                    high,
                    min(high + 8, len(points) - 1) if high + 1 < len(points) else (len(points)),
                )
            at = low
            corners.append((float(points[at][0]), float(points[at][1])))
        return tuple(corners)


def random_route(
    floor: Floor, rng: np.random.Generator, start: XY, length_m: float
) -> tuple[tuple[XY, ...], ...]:
    """Legs of 8 to 25 m to goals drawn at random, about `length_m` in all."""
    legs, left, at = [], length_m, start
    while left > 4.0:
        ways = floor.ways(at)
        near = min(8.0, left)
        places = ways.within(near, min(max(25.0, near + 1.0), left + 2.0))
        place = int(places[rng.integers(len(places))])
        leg = ways.to(place)
        if not leg:
            break
        legs.append(leg)
        left -= float(ways.length[place])
        at = leg[-1]
    return tuple(legs)


def _shifted(values: NDArray, dy: int, dx: int) -> tuple[NDArray, NDArray]:
    """Each cell and its neighbour at (dy, dx), dy 0 or 1."""
    height, width = values.shape
    a = values[: height - dy, max(-dx, 0) : width - max(dx, 0)]
    b = values[dy:, max(dx, 0) : width - max(-dx, 0)]
    return a, b
