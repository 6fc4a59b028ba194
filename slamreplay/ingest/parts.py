"""The eight parts of a replay bundle: which the log lacks, and what cannot be judged without."""

from __future__ import annotations

from collections.abc import Collection

from slamreplay.bundle.manifest import Missing
from slamreplay.bundle.schema import PARTS

#: Part to (what would have been it, what is out of reach without it).
_WITHOUT = {
    "odometry": (
        "no nav_msgs/Odometry outside a map frame, no odom -> base on tf, no measured twist",
        "wheel slip and the belief between two poses cannot be judged",
    ),
    "imu": (
        "no sensor_msgs/Imu",
        "turn rates have no second witness: slip while turning is judged from scans alone",
    ),
    "scans": (
        "no sensor_msgs/LaserScan, and no cloud that a scan could be made of",
        "neither where the robot was nor whether the map changed can be judged",
    ),
    "pose": (
        "no pose in a map frame, no map -> odom on tf",
        "there is no belief: whether the robot was lost cannot be judged",
    ),
    "covariance": (
        "no pose that carries a covariance",
        "whether the localizer's confidence was earned is told by particles alone, if at all",
    ),
    "map": (
        "no nav_msgs/OccupancyGrid map in the log, none given with --map",
        "neither lost nor changed can be judged against a map",
    ),
    "costmap": (
        "no costmap topic",
        "what the planner saw, and the clearance of its actions, cannot be judged",
    ),
    "recovery": (
        "no behaviour-tree log, no recovery's action, service event, status or log line",
        "recoveries can only be inferred from motion and costmaps",
    ),
}


def missing_parts(present: Collection[str]) -> list[Missing]:
    """An entry for each part that is not present, in the order of `PARTS`."""
    return [
        Missing(part=part, reason=_WITHOUT[part][0], consequence=_WITHOUT[part][1])
        for part in PARTS
        if part not in present
    ]
