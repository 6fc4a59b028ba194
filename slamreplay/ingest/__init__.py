"""Logs in, bundle out: readers (containers) and decoders (meaning) meet only in the pipeline.

A decoder is one file under `decoders/` and one line in `DECODERS`, which maps a message type's
normalised name (`pkg/msg/T`, also for ROS 1) to a `Decoder` (see `decoders.decoder`): the table it
fills and a function `decode(messages: Messages) -> Decoded`. `Messages` gives all messages of one
topic field by field as numpy columns, so a decoder never sees bytes or single messages; `Decoded`
holds the table's own columns (all but t_ns, t_sensor_ns, t_log_ns and topic, which the pipeline
adds), for each row the message it came from and its stamp, and what was repaired or rejected.
"""

from __future__ import annotations

from slamreplay.registry import Registry

_HERE = "slamreplay.ingest.decoders"

#: Message type to its decoder; other packages add theirs as entry points `slamreplay.decoders`.
DECODERS = Registry(
    "decoder",
    {
        "nav_msgs/msg/Odometry": f"{_HERE}.odometry:ODOMETRY",
        "sensor_msgs/msg/Imu": f"{_HERE}.imu:IMU",
        "sensor_msgs/msg/LaserScan": f"{_HERE}.laser_scan:LASER_SCAN",
        "sensor_msgs/msg/PointCloud2": f"{_HERE}.point_cloud:POINT_CLOUD",
        "geometry_msgs/msg/PoseWithCovarianceStamped": f"{_HERE}.pose:POSE_WITH_COVARIANCE",
        "geometry_msgs/msg/PoseStamped": f"{_HERE}.pose:POSE",
        "geometry_msgs/msg/PoseArray": f"{_HERE}.particles:POSE_ARRAY",
        "nav2_msgs/msg/ParticleCloud": f"{_HERE}.particles:PARTICLE_CLOUD",
        "tf2_msgs/msg/TFMessage": f"{_HERE}.transforms:TRANSFORMS",
        "tf/msg/tfMessage": f"{_HERE}.transforms:TRANSFORMS",
        "nav_msgs/msg/OccupancyGrid": f"{_HERE}.grid:OCCUPANCY_GRID",
        "nav2_msgs/msg/Costmap": f"{_HERE}.grid:COSTMAP",
        "map_msgs/msg/OccupancyGridUpdate": f"{_HERE}.grid_update:OCCUPANCY_GRID_UPDATE",
        "nav2_msgs/msg/CostmapUpdate": f"{_HERE}.grid_update:COSTMAP_UPDATE",
        "costmap_2d/msg/VoxelGrid": f"{_HERE}.voxel_grid:VOXEL_GRID",
        "nav2_msgs/msg/VoxelGrid": f"{_HERE}.voxel_grid:VOXEL_GRID",
        "nav_msgs/msg/Path": f"{_HERE}.path:PATH",
        "geometry_msgs/msg/Twist": f"{_HERE}.twist:TWIST",
        "geometry_msgs/msg/TwistStamped": f"{_HERE}.twist:TWIST_STAMPED",
        "nav2_msgs/msg/BehaviorTreeLog": f"{_HERE}.behavior_tree:BEHAVIOR_TREE_LOG",
        "fiducial_msgs/msg/FiducialTransformArray": f"{_HERE}.fiducials:FIDUCIAL_TRANSFORMS",
        "apriltag_ros/msg/AprilTagDetectionArray": f"{_HERE}.fiducials:APRILTAG_DETECTIONS",
        "sensor_msgs/msg/NavSatFix": f"{_HERE}.nav_sat_fix:NAV_SAT_FIX",
        "move_base_msgs/msg/RecoveryStatus": f"{_HERE}.recovery_status:RECOVERY_STATUS",
        "diagnostic_msgs/msg/DiagnosticArray": f"{_HERE}.health:DIAGNOSTICS",
        "rcl_interfaces/msg/Log": f"{_HERE}.health:LOG",
        "rosgraph_msgs/msg/Log": f"{_HERE}.health:LOG",
    },
)
