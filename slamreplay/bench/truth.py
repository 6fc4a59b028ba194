"""What the truth says of an incident, moment by moment and as a whole, by the report's definitions.

Moments are the scans' stamps. Lost is the recorded belief against the true pose; a map handed over
in another frame is taken off first, for then the map is wrong and not the robot. Changed is the
share of valid beams, cast from where they were really taken, that meet a change; something that was
seen for less than four seconds in all does not count as standing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bench.incidents import Incident
from slamreplay.bench.outlines import bbox, ends_in, passes
from slamreplay.bench.structure import changed_solids
from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.simulate import truth
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.sensors import XYYAW_BASE_LASER, XYYAW_BASE_REAR, Lidar, Scans
from slamreplay.simulate.worlds import Solid, World, rasterise

#: What beams met for a shorter time in all does not count as standing.
_STANDING_S = 4.0


@dataclass(frozen=True)
class TrueRegion:
    """Something that stands where the map has nothing, or the reverse.

    Attributes:
        kind: appeared or removed; what was moved is one of each.
        name: of the solid.
        bbox_m: in the frame of the map in the log.
        seen_s: for how long beams met it in all.
    """

    kind: str
    name: str
    bbox_m: tuple[float, float, float, float]
    seen_s: float


@dataclass(frozen=True, eq=False)
class Truth:
    """The labels of one log; N scans of its (first) laser.

    Attributes:
        t_ns: (N,) stamps.
        xyyaw: (N, 3) true base at the stamps, in the frame of the map in the log.
        xyyaw_taken: (N, 3) the same when the scans were really taken; late stamps part the two.
        belief: (N, 3) as recorded, NaN before the first one.
        far: (N,) belief beyond 0.5 m or 20 deg; False without a belief.
        changed_share: (N,) of the valid beams.
        lost: (N,) moments inside a stretch of 3 s or longer that is far.
        changed: (N,) moments inside a stretch of 2 s or longer of a share beyond 8 %.
        regions: what changed.
        state: of the log as a whole.
        frame_offset: (3,) the robot's own map frame in that of the map in the log.
    """

    t_ns: NDArray[np.int64]
    xyyaw: se2.Array
    xyyaw_taken: se2.Array
    belief: se2.Array
    far: NDArray[np.bool_]
    changed_share: se2.Array
    lost: NDArray[np.bool_]
    changed: NDArray[np.bool_]
    regions: tuple[TrueRegion, ...]
    state: str
    frame_offset: se2.Array

    @property
    def states(self) -> NDArray:
        """(N,) state of each moment: healthy, lost, map_changed or lost_and_map_changed."""
        return np.select(
            [self.lost & self.changed, self.lost, self.changed],
            ["lost_and_map_changed", "lost", "map_changed"],
            "healthy",
        )


def truth_of(incident: Incident, bundle: Bundle) -> Truth:
    """Label a log.

    Args:
        incident: what was simulated.
        bundle: the log of it: the belief is what was recorded, not what the filter thought.
    """
    r = incident.recording
    story = r.scenario
    start_ns = story.start_ns
    t_ns = start_ns + np.array([round(float(t + story.scan_late_s) * 1e9) for t in r.scans.t_s])
    last_s = float(r.motion.t_s[-1])
    own = r.motion.poses_at(np.minimum((t_ns - start_ns) / 1e9, last_s))
    offset = np.array(story.xyyaw_logged_map)
    belief = recorded_belief(bundle.view(), t_ns)
    believed = np.full((len(t_ns), 3), np.nan) if belief is None else belief.xyyaw
    with np.errstate(invalid="ignore"):
        far = truth.is_far(believed, own)
    share, regions = changes_of(r, offset)
    t_s = (t_ns - t_ns[0]) / 1e9
    lost = truth.in_stretches(t_s, far, truth.LOST_FOR_S, truth.GAP_S)
    beyond = share > truth.CHANGED_SHARE
    changed = truth.in_stretches(t_s, beyond, truth.CHANGED_FOR_S, truth.GAP_S)
    state = truth.verdict(t_s, far, t_s, share)
    if story.logged is not None:
        state = "insufficient_data"
    return Truth(
        t_ns,
        se2.compose(offset, own),
        se2.compose(offset, r.motion.poses_at(r.scans.t_s)),
        believed,
        far,
        share,
        lost,
        changed,
        regions,
        state,
        offset,
    )


def changes_of(r: Recording, offset: se2.Array) -> tuple[se2.Array, tuple[TrueRegion, ...]]:
    """Changed share of each scan of the first laser, beams of a second one pooled with it."""
    added, gone = changed_solids(r.scenario.mapped, r.scenario.standing)
    n = len(r.scans.t_s)
    if not added and not gone:
        return np.zeros(n), ()
    standing = _stood(r, added)
    changed, valid = np.zeros(n), np.zeros(n)
    seen = {s.name: np.zeros(n, dtype=bool) for s in (*added, *gone)}
    for lidar, scans, mount in _lasers(r):
        rays = _rays(r, lidar, scans, mount)
        ranges = scans.ranges.astype(np.float64).ravel()
        hit = truth.changed_beams(r.map, standing, rays, ranges, lidar.range_max_m)
        index = np.searchsorted(r.scans.t_s, scans.t_s - 1e-6).clip(0, n - 1)
        np.add.at(changed, index, hit.reshape(len(index), -1).sum(axis=1))
        np.add.at(valid, index, (ranges > 0.0).reshape(len(index), -1).sum(axis=1))
        reach = np.where(np.isfinite(ranges), ranges, lidar.range_max_m)
        for solid in added:
            on = ends_in(solid, rays, reach) & hit
            seen[solid.name][index] |= on.reshape(len(index), -1).any(axis=1)
        for solid in gone:
            on = passes(solid, rays, reach) & hit
            seen[solid.name][index] |= on.reshape(len(index), -1).any(axis=1)
    period = 1.0 / r.scenario.lidar.rate_hz
    regions = tuple(
        TrueRegion(kind, s.name, bbox(s, offset), float(seen[s.name].sum() * period))
        for kind, solids in (("appeared", added), ("removed", gone))
        for s in solids
    )
    return changed / np.maximum(valid, 1.0), regions


def _stood(r: Recording, added: list[Solid]) -> OccupancyGrid:
    """What stands, without new things that were not seen for long enough to be called standing."""
    if not added:
        return r.standing
    seconds = {s.name: 0.0 for s in added}
    for lidar, scans, mount in _lasers(r):
        rays = _rays(r, lidar, scans, mount)
        ranges = scans.ranges.astype(np.float64).ravel()
        reach = np.where(np.isfinite(ranges), ranges, -1.0)
        for s in added:
            on = (ends_in(s, rays, reach) & (reach > 0.0)).reshape(len(scans.t_s), -1)
            seconds[s.name] += float(on.any(axis=1).sum()) / lidar.rate_hz
    brief = [name for name, seen_s in seconds.items() if seen_s < _STANDING_S]
    if not brief:
        return r.standing
    world = r.scenario.standing.changed(without=brief)
    return rasterise(world, r.scenario.true_resolution_m, as_map=False)


def _lasers(r: Recording) -> list[tuple[Lidar, Scans, se2.Array]]:
    found = [(r.scenario.lidar, r.scans, XYYAW_BASE_LASER)]
    if r.rear is not None and r.scenario.rear is not None:
        found.append((r.scenario.rear, r.rear, XYYAW_BASE_REAR))
    return found


def _rays(r: Recording, lidar: Lidar, scans: Scans, mount: se2.Array) -> se2.Array:
    """(N * B, 3) true origin and direction of every beam in the robot's own map frame."""
    beam_t = (scans.t_s[:, None] + np.arange(lidar.beams) * lidar.time_increment_s).ravel()
    rays = se2.compose(r.motion.poses_at(beam_t), mount)
    rays[:, 2] += np.tile(lidar.bearings, len(scans.t_s))
    return rays


def changed_cells(r: Recording, grid: OccupancyGrid, world: World) -> NDArray[np.bool_]:
    """(H, W) cells of the log's map in which something stands in one world and not in the other.

    Args:
        r: the recording.
        grid: the map in the log.
        world: what stands today.
    """
    now = rasterise(world, r.scenario.true_resolution_m, as_map=False)
    then = rasterise(r.scenario.mapped, r.scenario.true_resolution_m, as_map=False)
    height, width = grid.cells.shape
    centres = grid.centre_of(np.indices((height, width)).reshape(2, -1).T)
    own = se2.transform_points(se2.inverse(np.array(r.scenario.xyyaw_logged_map)), centres)
    cells = now.cell_of(own)
    inside = now.inside(cells)
    cells = np.where(inside[:, None], cells, 0)
    differ = now.occupied != then.occupied
    return (differ[cells[:, 0], cells[:, 1]] & inside).reshape(height, width)
