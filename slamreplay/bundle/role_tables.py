"""The roles that topics play, and where their rows are."""

from __future__ import annotations

#: Which table the topic of a role has its rows in.
ROLE_TABLES = {
    "odometry": "odometry",
    "imu": "imu",
    "scan": "scans",
    "scan_2": "scans",
    "points": "points",
    "pose": "poses",
    "covariance": "poses",
    "initial_pose": "initial_poses",
    "particles": "particles",
    "costmap": "costmaps",
    "plan": "plans",
    "command": "commands",
    "velocity": "velocities",
    "joints": "joints",
    "magnetic_field": "magnetic_fields",
    "quality": "signals",
    "clock": "clock",
    "closure": "closures",
    "recovery": "recoveries",
    "reference": "references",
    "map": "map_updates",
}
