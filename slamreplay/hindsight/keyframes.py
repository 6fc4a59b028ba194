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
#: The same between two keyframes that scans and odometry put apart differently: along a corridor
#: few beams tell of a robot that is carried.
FINE_SHARE, FINE_M = 0.1, 0.15
MIN_POINTS = 10


def keyframes(
    beams: Beams,
    odometry: se2.Array,
    is_unknown: NDArray[np.bool_],
    is_held: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Indices of the keyframes among the scans.

    Args:
        beams: the scans.
        odometry: (N, 3) pose in the odom frame at each scan.
        is_unknown: (N,) scans to which the motion from the one before is not known; a keyframe
            stands on either side, so that no scan in between is carried over.
        is_held: (N,) scans that can be keyframes: the motion through the others is not known.
    """
    hit, reach = beams.kind == HIT, _reach(beams)
    enough = (hit.sum(axis=1) >= MIN_POINTS) & is_held
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
                moved = np.abs(reach[scan] - reach[last])[both] > NEW_M
                # A turn alone shifts ranges too, but odometry knows of turns.
                is_new = turn <= 0.05 and np.count_nonzero(moved) >= NEW_SHARE * count
                if count < MIN_POINTS or not is_new:
                    continue
        chosen.append(scan)
    return np.array(chosen, dtype=np.int64)


def with_more(
    beams: Beams, keys: NDArray[np.int64], is_torn: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """The same keyframes (K,) and more of them over links (K - 1,) that odometry missed."""
    chosen = keys.tolist()
    reach, hit = _reach(beams), beams.kind == HIT
    for link in np.flatnonzero(is_torn).tolist():
        last = int(keys[link])
        for scan in range(last + 1, int(keys[link + 1])):
            both = hit[scan] & hit[last]
            count = np.count_nonzero(both)
            moved = np.abs(reach[scan] - reach[last])[both] > FINE_M
            if count >= MIN_POINTS and np.count_nonzero(moved) >= FINE_SHARE * count:
                chosen.append(scan)
                last = scan
    return np.unique(np.array(chosen, dtype=np.int64))


def _reach(beams: Beams) -> NDArray[np.float32]:
    """(N, B) how far from the laser each beam ended, m."""
    return np.hypot(*np.moveaxis(beams.ends - beams.laser_xy.astype(np.float32), -1, 0))
