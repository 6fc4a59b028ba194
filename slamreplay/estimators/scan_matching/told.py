"""What odometry tells of the motion from scan to scan and within a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns

#: Between two samples no farther apart than this a motion is spread evenly; it is known to a part.
BRIDGED_S = 10.0


@dataclass(frozen=True, eq=False)
class Told:
    """Motion by odometry.

    Attributes:
        steps: (N, 3) from the scan before, in the axes of the base there; NaN where not told.
        is_bridged: (N,) steps of which only the sum over a gap in odometry is known.
        during: (N, 3) in each sweep, from its first to its last beam.
    """

    steps: se2.Array
    is_bridged: NDArray[np.bool_]
    during: se2.Array


def told_motion(scans: ScanSet, odometry: PoseTrack | None) -> Told:
    """The motion that odometry tells of a log's scans."""
    n, width = scans.ranges_m.shape
    steps, during = np.full((n, 3), np.nan), np.zeros((n, 3))
    if odometry is None or not n:
        return Told(steps, np.zeros(n, dtype=bool), during)
    close = odometry.at(scans.t_ns).xyyaw
    poses = odometry.at(scans.t_ns, max_gap_ns=ns(BRIDGED_S)).xyyaw
    is_bridged = np.isnan(close[:, 0]) & np.isfinite(poses[:, 0])
    steps[1:] = se2.between(poses[:-1], poses[1:])
    is_bridged[1:] |= is_bridged[:-1]
    sweep_s = np.nan_to_num(scans.time_increment_s) * (width - 1)
    if (sweep_s > 0.0).any():
        late_ns = np.where(sweep_s > 0.0, sweep_s * 1e9, 0.0).astype(np.int64)
        during = se2.between(close, odometry.at(scans.t_ns + late_ns).xyyaw)
        during = np.where(np.isfinite(during), during, 0.0)  # beyond odometry: left as it is
    return Told(steps, is_bridged, during)
