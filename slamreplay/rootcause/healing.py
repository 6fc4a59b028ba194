"""Evidence in which nothing is wrong: the log's own, put right by hindsight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.products import Changes
from slamreplay.bundle.scans import scan_set
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.geometry import se2
from slamreplay.maps.grid import FREE, OCCUPIED, OccupancyGrid
from slamreplay.maps.likelihood_field import distance_field
from slamreplay.rootcause.beams import Rows, beams_of, cleared
from slamreplay.rootcause.doses import Slip, calibrated, healed_steps, slips_of
from slamreplay.rootcause.first_pose import right_start
from slamreplay.rootcause.incident import Incident
from slamreplay.rootcause.likelihood import moments
from slamreplay.rootcause.replays import Evidence
from slamreplay.rootcause.tracks import filled, put_together, steps_of

#: Map beyond the way that the laser may reach and particles may stray to, m.
_AROUND_M = 15.0
#: Moments that have to be known for a replay to be compared with what was seen.
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class Healed:
    """What the log would have been with nothing wrong in it, and what was taken out of it.

    Attributes:
        evidence: for a filter: odometry, scans, map and start put right.
        truth: (N, 3) hindsight, its gaps filled.
        told_steps: (N - 1, 3) odometry's steps as recorded; hindsight's where there are none.
        steps: (N - 1, 3) the same without the errors it has all along and without slips.
        slips: what odometry and hindsight disagreed about.
        told_beams: the scans as they came, people and all.
        cut_share: (N,) share of beams that something cut short which is in no map.
        told_grid: the map as the robot had it.
    """

    evidence: Evidence
    truth: se2.Array
    told_steps: se2.Array
    steps: se2.Array
    slips: tuple[Slip, ...]
    told_beams: Rows
    cut_share: se2.Array
    told_grid: OccupancyGrid

    @property
    def steps_but_slips(self) -> se2.Array:
        """(N - 1, 3) odometry's steps as recorded, slips alone healed."""
        steps = self.told_steps.copy()
        for s in self.slips:
            steps[s.first : s.last] = self.steps[s.first : s.last]
        return steps

    def odometry_of(self, steps: se2.Array) -> se2.Array:
        """(N, 3) a path of such steps that begins where the robot was."""
        return put_together(self.truth[0], steps)


def healed(incident: Incident, config: AmclConfig) -> Healed | None:
    """The log of an incident put right; None without map or scans, or where hindsight is silent."""
    grid, scans = incident.view.grid, scan_set(incident.view)
    if grid is None or scans is None or len(moments(incident)) < _FEWEST:
        return None
    truth = filled(incident.t_ns, incident.where, incident.odometry)
    mended = healed_steps(calibrated(incident.odometry, incident.case.wheels), (), truth)
    slips = slips_of(incident, mended)
    steps = healed_steps(mended, slips, truth)
    told = healed_steps(steps_of(incident.odometry), (), truth)
    seen = np.concatenate([truth, incident.belief])
    old = cropped(grid, seen)
    changes = incident.case.hindsight.changes if _changed(incident) else None
    new = old if changes is None else cropped(corrected(grid, changes), seen)
    came = beams_of(incident, scans, config, new, truth)
    clear, share = cleared(came, new, truth)
    path = put_together(truth[0], steps)
    start = right_start(incident, truth)
    far = distance_field(new, config.laser_likelihood_max_dist)
    evidence = Evidence(path, clear, new, *start, config, far)
    return Healed(evidence, truth, told, steps, slips, came, share, old)


def _changed(incident: Incident) -> bool:
    """Whether the verdict holds the map for changed anywhere in the stretch.

    Less than that may be people who walked along, drawn into the corrected map.
    """
    low, high = int(incident.t_ns[0]), int(incident.t_ns[-1])
    intervals = incident.case.intervals
    return any(i.is_changed and i.start_ns <= high and i.end_ns >= low for i in intervals)


def cropped(grid: OccupancyGrid, poses: se2.Array) -> OccupancyGrid:
    """The part of a map that a robot at poses (N, 3) can see; NaN rows are left out."""
    poses = poses[np.isfinite(poses).all(axis=1)]
    cell = grid.cell_of(poses[:, :2])
    around = int(np.ceil(_AROUND_M / grid.resolution_m))
    height, width = grid.cells.shape
    low = np.clip(cell.min(axis=0) - around, 0, [height - 1, width - 1])
    high = np.clip(cell.max(axis=0) + around + 1, low + 1, [height, width])
    if (low == 0).all() and (high == [height, width]).all():
        return grid
    corner = np.array([low[1] * grid.resolution_m, low[0] * grid.resolution_m, 0.0])
    origin = se2.compose(grid.origin_xyyaw, corner)
    cells = grid.cells[low[0] : high[0], low[1] : high[1]].copy()
    return OccupancyGrid(cells, grid.resolution_m, origin, grid.frame_id)


def corrected(grid: OccupancyGrid, changes: Changes | None) -> OccupancyGrid:
    """The map with what changed in it put right; itself where nothing did."""
    if changes is None or not changes.regions:
        return grid
    cells = changes.corrected
    if cells is None:
        cells = np.where(changes.appeared, OCCUPIED, np.where(changes.removed, FREE, grid.cells))
    right = np.asarray(cells, dtype=np.int8).copy()
    return OccupancyGrid(right, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)
