"""All scans as beams about the robot: where each one ended, deskewed, in arrays for the kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.scans import ScanSet
from slamreplay.geometry import se2

INVALID, HIT, MISS = 0, 1, 2
#: A beam without a return proves free space no farther than this, whatever the driver claims.
MAX_REACH_M = 30.0
#: Nearer returns come from the robot itself more often than not.
MIN_RANGE_M = 0.15


@dataclass(frozen=True, eq=False)
class Beams:
    """Beams of N scans, B per scan.

    Attributes:
        t_ns: (N,) scan times.
        ends: (N, B, 2) float32 ends in the base frame at the scan's stamp, m; of a miss the point
            up to which it saw free space.
        kind: (N, B) int8 INVALID, HIT or MISS.
        laser_xy: (2,) where the beams start, in the base frame.
    """

    t_ns: NDArray[np.int64]
    ends: NDArray[np.float32]
    kind: NDArray[np.int8]
    laser_xy: se2.Array

    def __len__(self) -> int:
        return len(self.t_ns)

    def points(self, scan: int) -> se2.Array:
        """(M, 2) ends of the beams that hit something."""
        return self.ends[scan, self.kind[scan] == HIT].astype(np.float64)


def beams_of(scans: ScanSet) -> Beams:
    """Every beam of a scan set; a scan's own motion, from odometry, is taken out linearly."""
    n, width = scans.ranges_m.shape
    kind = np.where(scans.hits, HIT, np.where(scans.misses, MISS, INVALID)).astype(np.int8)
    limit = np.minimum(np.nan_to_num(scans.range_max_m, nan=0.0), MAX_REACH_M)
    reach = np.where(kind == MISS, limit[:, None], scans.ranges_m).astype(np.float32)
    beam = np.arange(width)
    bearing = scans.angle_min[:, None] + beam * scans.angle_increment[:, None]
    kind[~(reach >= MIN_RANGE_M) | ~np.isfinite(bearing)] = INVALID
    reach[kind == INVALID], bearing[kind == INVALID] = 0.0, 0.0
    mount = scans.xyyaw_base_laser
    ends = np.empty((n, width, 2), dtype=np.float32)
    ends[..., 0] = mount[0] + reach * np.cos(bearing + mount[2])
    ends[..., 1] = mount[1] + reach * np.sin(bearing + mount[2])
    sweep_s = scans.time_increment_s * (width - 1)
    if scans.odometry is not None and width > 1 and (sweep_s > 0.0).any():
        late_ns = np.where(sweep_s > 0.0, sweep_s * 1e9, 0.0).astype(np.int64)
        motion = se2.between(
            scans.odometry.at(scans.t_ns).xyyaw, scans.odometry.at(scans.t_ns + late_ns).xyyaw
        )
        motion = np.where(np.isfinite(motion), motion, 0.0)  # beyond the odometry: left as it is
        part = motion[:, None, :] * (beam / (width - 1))[:, None]
        cos, sin = np.cos(part[..., 2]), np.sin(part[..., 2])
        x, y = ends[..., 0].copy(), ends[..., 1].copy()
        ends[..., 0] = part[..., 0] + cos * x - sin * y
        ends[..., 1] = part[..., 1] + sin * x + cos * y
    return Beams(scans.t_ns, ends, kind, mount[:2].copy())
