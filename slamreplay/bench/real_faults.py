"""Which faults fit into a recorded log: where to cut, which walls to edit, and what that does.

Places are drawn from a seed, among those that enough beams see for long enough to be found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bench import inject, inject_map
from slamreplay.bench.injection import Box, Injection
from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.view import BundleView
from slamreplay.errors import UsageError
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.maps.grid import FREE, OCCUPIED, OccupancyGrid
from slamreplay.maps.raycast import cast_rays

Flags = NDArray[np.bool_]
FAR_M = 0.25
_PLACES = 4
_UNSEEN = "no piece of wall is seen by enough beams for long enough"


@dataclass(frozen=True, eq=False)
class Recorded:
    """A log as it was recorded, with a localizer that is right, and the trajectory taken as true.

    Attributes:
        view: the evidence; its belief is the trajectory.
        track_ns: (N,) scan times.
        xyyaw: (N, 3) base in map.
        scans: the laser that the places to edit are chosen with.
        share: (N,) beams that contradict the map as it is.
        own: (N,) scans at which the map as it is was called changed already.
    """

    view: BundleView
    track_ns: NDArray[np.int64]
    xyyaw: se2.Array
    scans: ScanSet
    share: se2.Array
    own: Flags

    @property
    def grid(self) -> OccupancyGrid:
        """The map as it is."""
        if self.view.grid is None:
            raise UsageError("the log has no map to edit")
        return self.view.grid


def kidnap(log: Recorded, rng: np.random.Generator) -> tuple[str, Injection]:
    """A stretch cut out over which the robot went some way."""
    t_ns, xy = log.track_ns, log.xyyaw[:, :2]
    start = int(rng.uniform(0.3, 0.45) * len(t_ns))
    apart = np.hypot(*(xy - xy[start]).T)
    later = np.flatnonzero((apart > 1.5) & (np.arange(len(t_ns)) > start))
    later = later[t_ns[later] <= t_ns[-1] - ns(8.0)]
    if not len(later):
        raise UsageError("the robot does not go far enough before the log's end")
    cut = (int(t_ns[start]), int(t_ns[later[0]]))
    seconds = (cut[0] - t_ns[0]) / NS_PER_S
    what = f"kidnap: {(cut[1] - cut[0]) / NS_PER_S:.1f} s cut out at {seconds:.1f} s"
    what += f", {apart[later[0]]:.1f} m on"
    return what, inject.kidnap(log.view, *cut)


def wrong_start(log: Recorded, rng: np.random.Generator) -> tuple[str, Injection]:
    """A belief put beside the robot."""
    start = int(log.track_ns[int(rng.uniform(0.25, 0.5) * len(log.track_ns))])
    bearing = rng.uniform(-np.pi, np.pi)
    offset = (1.2 * np.cos(bearing), 1.2 * np.sin(bearing), rng.choice([-0.5, 0.0, 0.5]))
    seconds = (start - log.track_ns[0]) / NS_PER_S
    what = f"belief put 1.2 m, {np.degrees(offset[2]):+.0f} deg away at {seconds:.1f} s"
    return what, inject.wrong_start(log.view, start, offset)


def appeared(log: Recorded, rng: np.random.Generator) -> tuple[str, Injection]:
    """A piece of wall that the map does not have."""
    for box in seen_boxes(log, rng):
        injection = inject_map.appeared(log.view, box)
        if _shows(injection, log):
            return f"walls off the map at {_text(box)}", injection
    raise UsageError(_UNSEEN)


def removed(log: Recorded, rng: np.random.Generator) -> tuple[str, Injection]:
    """A piece of wall that only the map has."""
    for box in free_boxes(log, rng):
        injection = inject_map.removed(log.view, box)
        if _shows(injection, log):
            return f"walls drawn at {_text(box)}", injection
    raise UsageError("no free place beside the path is seen by enough beams for long enough")


def moved(log: Recorded, rng: np.random.Generator) -> tuple[str, Injection]:
    """A piece of wall that the map has 0.7 m nearer to the path."""
    for box in seen_boxes(log, rng):
        centre = np.array([box[0] + box[2], box[1] + box[3]]) / 2
        near = log.xyyaw[np.nanargmin(np.hypot(*(log.xyyaw[:, :2] - centre).T)), :2]
        shift = (near - centre) / np.linalg.norm(near - centre) * 0.7
        injection = inject_map.moved(log.view, box, shift)
        if _shows(injection, log):
            what = f"walls of {_text(box)} drawn {shift[0]:+.1f}, {shift[1]:+.1f} m away"
            return what, injection
    raise UsageError(_UNSEEN)


def _shows(injection: Injection, log: Recorded) -> bool:
    """Whether the fault contradicts clearly more beams than allowed, for some seconds."""
    seconds = (log.track_ns[-1] - log.track_ns[0]) / NS_PER_S
    return bool((edited_beams(injection, log) > 0.12).mean() * seconds > 4.0)


def seen_boxes(log: Recorded, rng: np.random.Generator) -> Iterator[Box]:
    """Up to a dozen boxes of walls that many beams end on for seconds, but not most of them."""
    rows = np.flatnonzero(np.isfinite(log.xyyaw).all(axis=1))[::4]
    ends = [se2.transform_points(log.xyyaw[k], log.scans.points(int(k))) for k in rows]
    scan = np.repeat(np.arange(len(rows)), [len(e) for e in ends])
    points = np.concatenate(ends)
    beams = np.array([(log.scans.hits[k] | log.scans.misses[k]).sum() for k in rows])
    seconds = (log.track_ns[-1] - log.track_ns[0]) / NS_PER_S
    starts = points[rng.permutation(len(points))[:200]]
    for side in (1.0, 1.5, 2.2, 3.0):
        told = 0
        for centre in starts:
            box = (*(centre - side / 2), *(centre + side / 2))
            share = np.bincount(scan[in_box(points, box)], minlength=len(rows)) / beams
            long = (share > 0.14).mean() * seconds
            if long > 5.0 and np.quantile(share, 0.95) < 0.45 and _has_walls(log.grid, box):
                yield tuple(float(v) for v in box)  # type: ignore[misc]
                told += 1
            if told == _PLACES:
                break


def _has_walls(grid: OccupancyGrid, box: Sequence[float]) -> bool:
    return bool(in_box(grid.centre_of(np.argwhere(grid.occupied)), box, 0.0).any())


def free_boxes(log: Recorded, rng: np.random.Generator) -> Iterator[Box]:
    """A few boxes of free cells, away from path and walls, that many beams go through."""
    from scipy.ndimage import distance_transform_edt

    grid = log.grid
    away = distance_transform_edt(~grid.occupied) * grid.resolution_m
    rows = np.flatnonzero(np.isfinite(log.xyyaw).all(axis=1))
    path = log.xyyaw[rows, :2]
    some = rows[:: max(len(rows) // 40, 1)]
    lasers = se2.compose(log.xyyaw[some], log.scans.xyyaw_base_laser)
    bearings = log.scans.bearings(int(some[0]))[::3]
    far = float(log.scans.range_max_m[0])
    as_mapped = cast_rays(grid, lasers, bearings, far)
    seconds = (log.track_ns[-1] - log.track_ns[0]) / NS_PER_S
    for size in (0.5, 0.8, 1.2, 1.6):
        room = size * 0.75 + 0.3
        told = 0
        clear = np.argwhere(grid.free & (away > room))
        for cell in clear[rng.permutation(len(clear))[:150]]:
            centre = grid.centre_of(cell)
            gap = np.hypot(*(path - centre).T).min()
            if not room < gap < 4.0:
                continue
            box = (*(centre - size / 2), *(centre + size / 2))
            cells = grid.cells.copy()
            (r0, c0), (r1, c1) = (grid.cell_of(p) for p in (centre - size / 2, centre + size / 2))
            cells[min(r0, r1) : max(r0, r1) + 1, min(c0, c1) : max(c0, c1) + 1] = OCCUPIED
            drawn = OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw)
            nearer = cast_rays(drawn, lasers, bearings, far) < as_mapped - FAR_M
            if (nearer.mean(axis=1) > 0.14).mean() * seconds > 5.0:
                yield tuple(float(v) for v in box)  # type: ignore[misc]
                told += 1
            if told == _PLACES:
                break


def edited_beams(injection: Injection, log: Recorded) -> se2.Array:
    """(N,) share of each scan's valid beams that the edit makes contradict the map.

    Cast from the true poses into the edited map: a beam that ends nearer than the map says, away
    from every drawn wall and in the box where the walls were taken off, or one that goes on through
    the walls that were drawn. What lies behind unknown cells is unchanged.
    """
    from scipy.ndimage import distance_transform_edt

    grid = injection.view.grid
    if grid is None:
        raise UsageError("the log has no map to edit")
    scans = log.scans
    away = distance_transform_edt(~grid.occupied) * grid.resolution_m
    opaque = np.where(grid.occupied | (grid.cells < 0), OCCUPIED, FREE).astype(np.int8)
    told = OccupancyGrid(opaque, grid.resolution_m, grid.origin_xyyaw)
    poses = se2.compose(log.xyyaw, scans.xyyaw_base_laser)
    shares = np.zeros(len(poses))
    taken = injection.box_m if injection.kind in ("appeared", "moved") else None
    drawn = injection.box_m if injection.kind == "removed" else injection.from_box_m
    for k in np.flatnonzero(np.isfinite(poses).all(axis=1)):
        valid = scans.hits[k] | scans.misses[k]
        if not valid.any():
            continue
        bearings = scans.bearings(int(k))[valid]
        measured = np.where(scans.hits[k], scans.ranges_m[k], scans.range_max_m[k])[valid]
        measured = measured.astype(np.float64)
        said = cast_rays(told, poses[k : k + 1], bearings, float(scans.range_max_m[k]))[0]
        changed = np.zeros(len(bearings), dtype=bool)
        if taken is not None:
            ends = _ends(poses[k], bearings, measured)
            cell = np.clip(grid.cell_of(ends), 0, np.array(grid.cells.shape) - 1)
            far = away[cell[:, 0], cell[:, 1]] > FAR_M
            nearer = scans.hits[k][valid] & (said - measured > FAR_M)
            changed |= nearer & far & in_box(ends, taken)
        if drawn is not None:
            reach = np.where(np.isfinite(said), said, 0.0) + 0.5 * grid.resolution_m
            walls = _ends(poses[k], bearings, reach)
            cell = np.clip(grid.cell_of(walls), 0, np.array(grid.cells.shape) - 1)
            wall = grid.occupied[cell[:, 0], cell[:, 1]]
            changed |= (measured - said > FAR_M) & wall & in_box(walls, drawn)
        shares[k] = changed.mean()
    return shares


def _ends(pose: se2.Array, bearings: se2.Array, reach: se2.Array) -> se2.Array:
    angle = pose[2] + bearings
    return np.column_stack([pose[0] + reach * np.cos(angle), pose[1] + reach * np.sin(angle)])


def in_box(points: se2.Array, box: Sequence[float], grow_m: float = 0.1) -> Flags:
    """(N,) which points (N, 2) lie in a box that is grown a little."""
    low, high = np.array(box[:2]) - grow_m, np.array(box[2:]) + grow_m
    return np.asarray(((points >= low) & (points <= high)).all(axis=1))


def _text(box: Box) -> str:
    return f"({box[0]:.1f}, {box[1]:.1f}, {box[2]:.1f}, {box[3]:.1f})"


#: Every fault, in the order of the table.
FAULTS = (kidnap, wrong_start, appeared, removed, moved)
