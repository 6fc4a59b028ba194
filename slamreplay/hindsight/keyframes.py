"""Which scans carry the trajectory: those after some motion, and those that suddenly look new."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, Beams

STEP_M, STEP_RAD = 0.25, 0.2
#: Beams that must differ, by how much, before a scan that odometry calls motionless is a keyframe:
#: a robot that is carried or pushed sees the world move while its wheels stand.
NEW_SHARE, NEW_M = 0.4, 0.3
MIN_POINTS = 10


def keyframes(
    beams: Beams, odometry: se2.Array, is_unknown: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Indices of the keyframes among the scans.

    Args:
        beams: the scans.
        odometry: (N, 3) pose in the odom frame at each scan.
        is_unknown: (N,) scans to which the motion from the one before is not known; a keyframe
            stands on either side, so that no scan in between is carried over.
    """
    reach = np.hypot(*np.moveaxis(beams.ends - beams.laser_xy.astype(np.float32), -1, 0))
    hit = beams.kind == HIT
    enough = hit.sum(axis=1) >= MIN_POINTS
    usable = np.flatnonzero(enough)
    part = np.cumsum(is_unknown)[usable]
    at_edge = np.zeros(len(beams), dtype=bool)
    at_edge[usable[1:][part[1:] > part[:-1]]] = True
    at_edge[usable[:-1][part[1:] > part[:-1]]] = True
    chosen: list[int] = []
    for scan in usable.tolist():
        if chosen and not at_edge[scan]:
            last = chosen[-1]
            dx, dy = odometry[scan, :2] - odometry[last, :2]
            turn = abs(float(se2.wrap_angle(odometry[scan, 2] - odometry[last, 2])))
            if dx * dx + dy * dy < STEP_M * STEP_M and turn < STEP_RAD:
                both = hit[scan] & hit[last]
                count = np.count_nonzero(both)
                if count < MIN_POINTS:
                    continue
                moved = np.abs(reach[scan] - reach[last])[both] > NEW_M
                # A turn alone shifts ranges too, but odometry knows of turns.
                if turn > 0.05 or np.count_nonzero(moved) < NEW_SHARE * count:
                    continue
        chosen.append(scan)
    return np.array(chosen, dtype=np.int64)
