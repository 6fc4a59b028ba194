"""The localizer on board: AMCL, fed live."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.simulate.onboard import OnboardFilter
from slamreplay.simulate.sensors import XYYAW_BASE_LASER, Lidar, Odometry, Scans


@dataclass(frozen=True, eq=False)
class Beliefs:
    """What the localizer said, one row per scan.

    Attributes:
        map_odom: (N, 3) T_map_odom as sent to tf after each scan.
        updated: (N,) whether the scan moved the filter; only then a pose is published.
        mean: (N, 3) the pose of the last update.
        cov: (N, 3, 3) its covariance.
    """

    map_odom: se2.Array
    updated: NDArray[np.bool_]
    mean: se2.Array
    cov: se2.Array


def localize(
    grid: OccupancyGrid,
    lidar: Lidar,
    scans: Scans,
    odometry: Odometry,
    start: tuple[se2.Array, se2.Array],
    seed: int,
    config: AmclConfig,
) -> Beliefs:
    """Run AMCL over all scans from a start pose (3,) with covariance (3, 3)."""
    amcl = OnboardFilter(config, grid, seed)
    amcl.initialise(*start)
    base = odometry_at(odometry, scans.t_s)
    n = len(scans.t_s)
    updated = np.zeros(n, dtype=bool)
    map_odom, mean, cov = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3))
    for i in range(n):
        ranges = scans.ranges[i].astype(np.float64)
        usable = np.isfinite(ranges) & (ranges >= lidar.range_min_m)
        updated[i] = amcl.update(
            base[i], lidar.bearings, ranges, usable, XYYAW_BASE_LASER, lidar.range_max_m
        )
        if updated[i]:
            mean[i], cov[i] = amcl.mean_xyyaw, amcl.cov
            map_odom[i] = se2.compose(mean[i], se2.inverse(base[i]))
        else:
            mean[i], cov[i], map_odom[i] = mean[i - 1], cov[i - 1], map_odom[i - 1]
    return Beliefs(map_odom, updated, mean, cov)


def odometry_at(odometry: Odometry, t_s: se2.Array) -> se2.Array:
    """(M, 3) base poses in odom between the odometry's samples."""
    ns = np.rint(odometry.t_s * 1e9).astype(np.int64)
    return se2.interpolate(ns, odometry.xyyaw, np.rint(t_s * 1e9).astype(np.int64))
