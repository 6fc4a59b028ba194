"""Layouts of costmap messages that no type store of rosbags has.

Sources: ros-navigation/navigation2 (nav2_msgs/msg/VoxelGrid.msg), ros-planning/navigation
(costmap_2d/msg/VoxelGrid.msg).
"""

from __future__ import annotations

_VOXEL_GRID = (
    "std_msgs/Header header\n"
    "uint32[] data\n"
    "geometry_msgs/Point32 origin\n"
    "geometry_msgs/Vector3 resolutions\n"
    "uint32 size_x\n"
    "uint32 size_y\n"
    "uint32 size_z\n"
)

COSTMAPS: dict[str, str] = {
    "costmap_2d/msg/VoxelGrid": _VOXEL_GRID,
    "nav2_msgs/msg/VoxelGrid": _VOXEL_GRID,
}
