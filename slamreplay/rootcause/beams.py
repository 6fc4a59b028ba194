"""The scans as a filter takes them: as they came, and as they would have been in an empty place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slamreplay.bundle.scans import ScanSet
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.laser import Beams, used_beams
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.rootcause.incident import Incident

#: A beam that ends so much before the wall, m and as a share of the way to it, ends on something
#: that is in no map.
SHORT_M, SHORT_SHARE = 0.3, 0.05

Rows = tuple[Beams | None, ...]


def beams_of(
    incident: Incident, scans: ScanSet, config: AmclConfig, grid: OccupancyGrid, truth: se2.Array
) -> Rows:
    """The beams of each row; where a scan never came, those that it would have had.

    Args:
        incident: for its rows.
        scans: of the log.
        config: which beams a filter uses.
        grid: what stands there.
        truth: (N, 3) where the robot was.
    """
    rows = np.minimum(np.searchsorted(scans.t_ns, incident.t_ns), len(scans) - 1)
    out: list[Beams | None] = []
    for k, row in enumerate(rows.tolist()):
        reach, mount = float(scans.range_max_m[row]), scans.xyyaw_base_laser
        bearings = scans.bearings(row)
        if not incident.missing[k]:
            if scans.t_ns[row] != incident.t_ns[k]:  # a row of another laser
                out.append(None)
                continue
            hits, misses = scans.hits[row], scans.misses[row]
            told = (bearings, scans.ranges_m[row], hits, mount, reach, misses)
        else:
            bearings = bearings[:: max(1, (len(bearings) - 1) // max(config.max_beams - 1, 1))]
            laser = se2.compose(truth[k], mount)
            ranges = cast_rays(grid, laser, bearings, reach)[0]
            told = (bearings, ranges, np.isfinite(ranges), mount, reach, ~np.isfinite(ranges))
        out.append(used_beams(config, *told))
    return tuple(out)


def cleared(
    beams: Sequence[Beams | None], grid: OccupancyGrid, truth: se2.Array
) -> tuple[Rows, se2.Array]:
    """The same beams with those that were cut short ending on the wall behind.

    Args:
        beams: of N rows.
        grid: what stands there.
        truth: (N, 3) where the robot was.

    Returns:
        The beams, and the share (N,) of each row that was cut short, NaN without beams.
    """
    out: list[Beams | None] = []
    share = np.full(len(beams), np.nan)
    for k, one in enumerate(beams):
        if one is None or not len(one):
            out.append(one)
            continue
        laser = se2.compose(truth[k], one.xyyaw_base_laser)
        wall = cast_rays(grid, laser, one.bearings, one.reach_m)[0]
        cut = one.ranges_m < wall - np.maximum(SHORT_M, SHORT_SHARE * np.minimum(wall, 1e3))
        share[k] = cut.mean()
        ranges = np.where(cut, wall, one.ranges_m)
        there = np.isfinite(ranges)
        out.append(replace(one, bearings=one.bearings[there], ranges_m=ranges[there]))
    return tuple(out), share
