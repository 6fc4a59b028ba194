"""Places that the robot passes and sees, by its own belief."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.scans import ScanSet, scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2, se3
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.perturb.beams import scan_rows

#: Scans that are looked at, evenly spread over the log, and places that are drawn among what they
#: see, of which one is taken that is seen by half as many scans as the best, or more.
_SCANS, _PLACES = 300, 150
#: Places are so far from the robot that sees them, m.
_NEAR_M, _FAR_M = 1.0, 6.0
#: A beam ends at a wall of the map within this, m: what a belief is off by, and cells are wide.
_AT_WALL_M = 0.2
#: Free places keep this far from walls and, where they can, from the robot's path, m.
_CLEAR_M, _OFF_PATH_M = 0.3, 0.7


@dataclass(frozen=True, eq=False)
class Seen:
    """Scans of a view, each from where the robot believed to be.

    Attributes:
        grid: the map.
        scans: S of them.
        laser: (S, 3) the laser in the map frame.
        measured: (S, B) range of each beam, inf where nothing came back, NaN where it is invalid.
    """

    grid: OccupancyGrid
    scans: ScanSet
    laser: se2.Array
    measured: se2.Array

    @classmethod
    def by(cls, view: BundleView, grid: OccupancyGrid, name: str) -> Seen:
        """What is seen by the recorded belief, or from the initial pose on by odometry.

        Raises:
            NotApplicableError: the log has no scans, or nothing that says where the robot was.
        """
        rows = scan_rows(view, name)
        table = view.table("scans").take(rows[:: max(len(rows) // _SCANS, 1)])
        scans = scan_set(view.with_table(table))
        where = None if scans is None else _whereabouts(view, scans.t_ns)
        if scans is None or where is None or not np.isfinite(where).any():
            raise NotApplicableError("nothing says where in the map the robot was", where=name)
        measured = np.where(scans.hits, scans.ranges_m, np.nan)
        measured[scans.misses] = np.inf
        return cls(grid, scans, se2.compose(where, scans.xyyaw_base_laser), measured)

    def wall(self, rng: np.random.Generator) -> tuple[se2.Array, se2.Array] | None:
        """(2,) a mapped wall, at a cell's centre, and (2,) the nearest place of the robot.

        Drawn from what the beams end on; None where none ends on a wall.
        """
        ends = self._ends(rng, np.ones(_PLACES))
        cells = self._nearest_wall(ends)
        places = self.grid.centre_of(cells[cells[:, 0] >= 0])
        off, ahead = self._towards(places)
        sees = np.abs(ahead - off) < _AT_WALL_M + self.grid.resolution_m
        return self._chosen(places, sees)

    def free(self, rng: np.random.Generator) -> tuple[se2.Array, se2.Array] | None:
        """(2,) a free place, at a cell's centre, and (2,) the nearest place of the robot.

        Drawn from where beams go through; None where no such place is free in the map.
        """
        ends = self._ends(rng, rng.uniform(0.3, 0.8, _PLACES))
        cells = self.grid.cell_of(ends)
        cells = cells[self._is_clear(cells)]
        places = self.grid.centre_of(cells)
        off, ahead = self._towards(places)
        sees = (ahead > off + _CLEAR_M) & (off < _FAR_M)
        path = np.nanmin(off, axis=1) if len(off) else np.empty(0)
        beside = np.asarray((path > _OFF_PATH_M) & sees.any(axis=1))
        if beside.any():
            places, sees = places[beside], sees[beside]
        return self._chosen(places, sees)

    def _ends(self, rng: np.random.Generator, part: se2.Array) -> se2.Array:
        """(P, 2) places on beams that came back, this part (P,) of the way to their ends."""
        near = (self.measured > _NEAR_M) & (self.measured < _FAR_M)
        near &= np.isfinite(self.laser[:, :1])
        scan, beam = np.nonzero(near)
        if not len(scan):
            return np.empty((0, 2))
        k = rng.integers(len(scan), size=len(part))
        scan, beam = scan[k], beam[k]
        turn = self.scans.angle_min[scan] + beam * self.scans.angle_increment[scan]
        reach = self.measured[scan, beam] * part
        ends = np.column_stack([reach * np.cos(turn), reach * np.sin(turn)])
        return se2.transform_points(self.laser[scan], ends[:, None])[:, 0]

    def _towards(self, places: se2.Array) -> tuple[se2.Array, se2.Array]:
        """(P, S) distance of each place from each scan, and the range measured towards it."""
        off = se2.transform_points(se2.inverse(self.laser), places[None])  # (S, P, 2)
        first, step = self.scans.angle_min[:, None], self.scans.angle_increment[:, None]
        turn = (np.arctan2(off[..., 1], off[..., 0]) - first) * np.sign(step)
        with np.errstate(invalid="ignore", divide="ignore"):
            beam = np.rint(np.mod(turn, 2.0 * np.pi) / np.abs(step))
        inside = beam < self.measured.shape[1]
        scan = np.arange(len(off))[:, None]
        ahead = self.measured[scan, np.where(inside, beam, 0).astype(np.int64)]
        ahead = np.where(inside, ahead, np.nan)
        return np.hypot(off[..., 0], off[..., 1]).T, ahead.T

    def _chosen(
        self, places: se2.Array, sees: NDArray[np.bool_]
    ) -> tuple[se2.Array, se2.Array] | None:
        """The first drawn of the places (P, 2) that enough scans see, by the mask (P, S)."""
        count = sees.sum(axis=1)
        if not count.any():
            return None
        place = places[np.argmax(2 * count >= count.max())]
        apart = np.hypot(*(self.laser[:, :2] - place).T)
        return place, self.laser[int(np.nanargmin(apart)), :2]

    def _nearest_wall(self, ends: se2.Array) -> NDArray[np.int64]:
        """(P, 2) wall cell nearest to each place, -1 where none is near."""
        around = _disc(_AT_WALL_M / self.grid.resolution_m)  # the nearest first
        cells = self.grid.cell_of(ends)[:, None] + around[None]
        is_wall = self._at(cells, self.grid.occupied)
        nearest = cells[np.arange(len(cells)), np.argmax(is_wall, axis=1)]
        return np.where(is_wall.any(axis=1, keepdims=True), nearest, -1)

    def _is_clear(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(P,) free cells (P, 2) without a wall near."""
        around = _disc(_CLEAR_M / self.grid.resolution_m)
        walls = self._at(cells[:, None] + around[None], self.grid.occupied)
        return self._at(cells, self.grid.free) & ~walls.any(axis=1)

    def _at(self, cells: NDArray[np.int64], layer: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(...) the layer at cells (..., 2), false outside of the map."""
        inside = self.grid.inside(cells)
        at = np.where(inside[..., None], cells, 0)
        return inside & layer[at[..., 0], at[..., 1]]


def disc_around(grid: OccupancyGrid, place_xy: se2.Array, size_m: float) -> NDArray[np.int64]:
    """(N, 2) cells of a map whose centres lie in a disc of that diameter about a cell's centre."""
    middle, radius = grid.cell_of(place_xy), size_m / 2.0 / grid.resolution_m
    off_row, off_col = (np.arange(n) - at for n, at in zip(grid.cells.shape, middle, strict=True))
    return np.argwhere(np.hypot(off_row[:, None], off_col[None]) <= radius + 1e-9)


def _disc(radius: float) -> NDArray[np.int64]:
    """(N, 2) rows and columns within so many cells of the origin, the nearest first."""
    n = int(radius + 1e-9)
    row, col = np.mgrid[-n : n + 1, -n : n + 1].reshape(2, -1)
    apart = np.hypot(row, col)
    order = np.argsort(apart, kind="stable")
    order = order[apart[order] <= radius + 1e-9]
    return np.column_stack([row, col])[order]


def _whereabouts(view: BundleView, t_ns: NDArray[np.int64]) -> se2.Array | None:
    """(N, 3) base in map at times (N,)."""
    belief = recorded_belief(view, t_ns)
    if belief is not None and belief.has_pose.any():
        return belief.xyyaw
    odometry, given = odometry_track(view), view.role("initial_pose")
    if odometry is None or given is None or not len(given):
        return None
    yaw = se3.yaw_from_quaternion(given["orientation_xyzw"][:1])
    start = np.column_stack([given["position_xyz"][:1, :2], yaw])
    # A pose that was given before odometry is known holds where it begins.
    first_ns = np.maximum(given.t_ns[:1], odometry.t_ns.min(initial=given.t_ns[0]))
    moved = se2.between(odometry.at(first_ns).xyyaw, odometry.at(t_ns).xyyaw)
    return se2.compose(start, moved)
