"""What each beam of a simulated log met, by the simulator's own knowledge of what stood where."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from slamreplay.bench.structure import changed_solids
from slamreplay.evidence.scene import Met
from slamreplay.geometry import se2
from slamreplay.maps.raycast import cast_rays
from slamreplay.simulate.people import ranges_to
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.sensors import XYYAW_BASE_LASER, XYYAW_BASE_REAR, Lidar, Scans
from slamreplay.simulate.topics import START_NS
from slamreplay.simulate.worlds import Solid, rasterise

#: Of beams of which nothing is asked: without a return, or on what lies about a mapped wall.
UNASKED = -1
_NOISE_M, _NEAR_M, _THROUGH_M = 0.05, 0.3, 0.3


def truth_of_beams(recording: Recording) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of each laser the stamps (N,) and (N, B) Met as it should be, or UNASKED."""
    r = recording
    lasers = [(r.scenario.lidar, r.scans, XYYAW_BASE_LASER)]
    if r.rear is not None:
        lasers.append((r.scenario.rear, r.rear, XYYAW_BASE_REAR))
    return [
        (
            START_NS + np.array([round(float(t) * 1e9) for t in scans.t_s]),
            _of_laser(r, lidar, scans, mount).reshape(scans.ranges.shape),
        )
        for lidar, scans, mount in lasers
    ]


def _of_laser(r: Recording, lidar: Lidar, scans: Scans, mount: np.ndarray) -> np.ndarray:
    t_s = (scans.t_s[:, None] + np.arange(lidar.beams) * lidar.time_increment_s).ravel()
    rays = se2.compose(r.motion.poses_at(t_s), mount)
    rays[:, 2] += np.tile(lidar.bearings, len(scans.t_s))
    ranges = scans.ranges.astype(np.float64).ravel()
    added, gone = changed_solids(r.scenario.mapped, r.scenario.standing)
    still = [s for s in r.scenario.standing.solids if s not in added]
    to_still, to_added, to_gone = (_cast(r, solids, rays) for solids in (still, added, gone))
    to_person = ranges_to(r.scenario.walkers, t_s, rays)
    hit = np.isfinite(ranges) & (ranges > 0.0)
    to_still, to_added, to_person = (np.minimum(to, 1e3) for to in (to_still, to_added, to_person))
    first = np.minimum(np.minimum(to_still, to_added), to_person)
    met = np.full(len(ranges), UNASKED)
    for to, code in (
        (to_still, Met.MAPPED),
        (to_added, Met.APPEARED),
        (to_person, Met.MOVING),
    ):
        met[hit & (to == first) & (np.abs(np.where(hit, ranges, 0.0) - to) < _NOISE_M)] = code
    about_a_wall = _to_mapped(r, rays, ranges) < _NEAR_M
    met[about_a_wall & (met != Met.MAPPED)] = UNASKED
    met[hit & (to_gone < ranges - _THROUGH_M)] = Met.REMOVED
    met[ranges == 0.0] = Met.INVALID
    return met


def _cast(r: Recording, solids: list[Solid], rays: np.ndarray) -> np.ndarray:
    if not solids:
        return np.full(len(rays), np.inf)
    world = replace(r.scenario.standing, solids=tuple(solids))
    grid = rasterise(world, r.scenario.true_resolution_m, as_map=False)
    return cast_rays(grid, rays, np.zeros(1), r.scenario.lidar.range_max_m + 1.0)[:, 0]


def _to_mapped(r: Recording, rays: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """(K,) from the beams' ends to the nearest mapped wall, m; inf off the map."""
    reach = np.where(np.isfinite(ranges), ranges, 0.0)
    ends = rays[:, :2] + reach[:, None] * np.column_stack([np.cos(rays[:, 2]), np.sin(rays[:, 2])])
    cells = r.map.cell_of(ends)
    inside = r.map.inside(cells)
    out = np.full(len(rays), np.inf)
    apart = distance_transform_edt(~r.map.occupied) * r.map.resolution_m
    out[inside] = apart[tuple(cells[inside].T)]
    return out
