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
from slamreplay.stage import callable_stage

_HERE = "slamreplay.ingest.decoders"
_BEHAVIOURS = ("Spin", "BackUp", "Wait", "DriveOnHeading", "AssistedTeleop")
_NAVIGATIONS = ("NavigateToPose", "NavigateThroughPoses")
_CLEARINGS = ("ClearEntireCostmap", "ClearCostmapAroundRobot", "ClearCostmapExceptRegion",
              "ClearCostmapAroundPose")  # fmt: skip

#: Message type to its decoder; other packages add theirs as entry points `slamreplay.decoders`.
DECODERS = Registry(
    "decoder",
    {
        "nav_msgs/msg/Odometry": f"{_HERE}.odometry:ODOMETRY",
        "sensor_msgs/msg/Imu": f"{_HERE}.imu:IMU",
        "sensor_msgs/msg/LaserScan": f"{_HERE}.laser_scan:LASER_SCAN",
        "sensor_msgs/msg/MultiEchoLaserScan": (
            f"{_HERE}.multi_echo_laser_scan:MULTI_ECHO_LASER_SCAN"
        ),
        "sensor_msgs/msg/PointCloud": f"{_HERE}.point_cloud_ros1:POINT_CLOUD_ROS1",
        "sensor_msgs/msg/PointCloud2": f"{_HERE}.point_cloud:POINT_CLOUD",
        "geometry_msgs/msg/PoseWithCovarianceStamped": f"{_HERE}.pose:POSE_WITH_COVARIANCE",
        "geometry_msgs/msg/PoseStamped": f"{_HERE}.pose:POSE",
        "geometry_msgs/msg/PoseArray": f"{_HERE}.particles:POSE_ARRAY",
        "nav2_msgs/msg/ParticleCloud": f"{_HERE}.particles:PARTICLE_CLOUD",
        "tf2_msgs/msg/TFMessage": f"{_HERE}.transforms:TRANSFORMS",
        "tf/msg/tfMessage": f"{_HERE}.transforms:TRANSFORMS",
        "sensor_msgs/msg/JointState": f"{_HERE}.joint_state:JOINT_STATE",
        "sensor_msgs/msg/MagneticField": f"{_HERE}.magnetic_field:MAGNETIC_FIELD",
        "std_msgs/msg/Float32": f"{_HERE}.signals:NUMBER",
        "std_msgs/msg/Float64": f"{_HERE}.signals:NUMBER",
        "geometry_msgs/msg/Vector3Stamped": f"{_HERE}.signals:VECTOR_STAMPED",
        "autoware_internal_debug_msgs/msg/Float32Stamped": f"{_HERE}.signals:NUMBER_STAMPED",
        "tier4_debug_msgs/msg/Float32Stamped": f"{_HERE}.signals:NUMBER_STAMPED",
        "nav_msgs/msg/OccupancyGrid": f"{_HERE}.grid:OCCUPANCY_GRID",
        "nav2_msgs/msg/Costmap": f"{_HERE}.grid:COSTMAP",
        "map_msgs/msg/OccupancyGridUpdate": f"{_HERE}.grid_update:OCCUPANCY_GRID_UPDATE",
        "nav2_msgs/msg/CostmapUpdate": f"{_HERE}.grid_update:COSTMAP_UPDATE",
        "costmap_2d/msg/VoxelGrid": f"{_HERE}.voxel_grid:VOXEL_GRID",
        "nav2_msgs/msg/VoxelGrid": f"{_HERE}.voxel_grid:VOXEL_GRID",
        "nav_msgs/msg/Path": f"{_HERE}.path:PATH",
        "geometry_msgs/msg/Twist": f"{_HERE}.twist:TWIST",
        "geometry_msgs/msg/TwistStamped": f"{_HERE}.twist:TWIST_STAMPED",
        "geometry_msgs/msg/TwistWithCovarianceStamped": f"{_HERE}.twist:TWIST_WITH_COVARIANCE",
        "ackermann_msgs/msg/AckermannDrive": f"{_HERE}.ackermann:ACKERMANN_DRIVE",
        "ackermann_msgs/msg/AckermannDriveStamped": f"{_HERE}.ackermann:ACKERMANN_DRIVE_STAMPED",
        "nav2_msgs/msg/BehaviorTreeLog": f"{_HERE}.behavior_tree:BEHAVIOR_TREE_LOG",
        "fiducial_msgs/msg/FiducialTransformArray": f"{_HERE}.fiducials:FIDUCIAL_TRANSFORMS",
        "apriltag_ros/msg/AprilTagDetectionArray": f"{_HERE}.fiducials:APRILTAG_DETECTIONS",
        "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray": (
            f"{_HERE}.tags:ISAAC_DETECTIONS"
        ),
        "aruco_msgs/msg/MarkerArray": f"{_HERE}.tags:ARUCO_MARKERS",
        "aruco_msgs/msg/Marker": f"{_HERE}.tags:ARUCO_MARKER",
        "ros2_aruco_interfaces/msg/ArucoMarkers": f"{_HERE}.tags:ARUCO_LISTS",
        "aruco_interfaces/msg/ArucoMarkers": f"{_HERE}.tags:ARUCO_LISTS",
        "ar_track_alvar_msgs/msg/AlvarMarkers": f"{_HERE}.tags:ALVAR_MARKERS",
        "cartographer_ros_msgs/msg/LandmarkList": f"{_HERE}.tags:LANDMARKS",
        "sensor_msgs/msg/NavSatFix": f"{_HERE}.nav_sat_fix:NAV_SAT_FIX",
        "move_base_msgs/msg/RecoveryStatus": f"{_HERE}.recovery_status:RECOVERY_STATUS",
        "nav2_msgs/msg/CollisionMonitorState": f"{_HERE}.safety_state:COLLISION_MONITOR",
        "nav2_msgs/msg/CollisionDetectorState": f"{_HERE}.safety_state:COLLISION_DETECTOR",
        "nav2_msgs/msg/SpeedLimit": f"{_HERE}.safety_state:SPEED_LIMIT",
        "action_msgs/msg/GoalStatusArray": f"{_HERE}.goal_status:GOAL_STATUS",
        "actionlib_msgs/msg/GoalStatusArray": f"{_HERE}.goal_status:GOAL_STATUS_ROS1",
        **{
            f"nav2_msgs/action/{action}_FeedbackMessage": f"{_HERE}.action_feedback:BEHAVIOUR"
            for action in _BEHAVIOURS
        },
        **{
            f"nav2_msgs/action/{action}_FeedbackMessage": f"{_HERE}.action_feedback:NAVIGATION"
            for action in _NAVIGATIONS
        },
        **{
            f"{package}/action/DockRobot_FeedbackMessage": f"{_HERE}.action_feedback:DOCKING"
            for package in ("nav2_msgs", "opennav_docking_msgs")
        },
        **{
            f"nav2_msgs/action/{action}_SendGoal_Event": f"{_HERE}.service_event:GOAL_SENT"
            for action in (*_BEHAVIOURS, *_NAVIGATIONS)
        },
        **{
            f"nav2_msgs/srv/{service}_Event": f"{_HERE}.service_event:CLEARING"
            for service in _CLEARINGS
        },
        "std_srvs/srv/Empty_Event": f"{_HERE}.service_event:EMPTY",
        "nav2_msgs/srv/SetInitialPose_Event": f"{_HERE}.set_initial_pose:SET_INITIAL_POSE",
        "move_base_msgs/msg/MoveBaseActionGoal": f"{_HERE}.move_base:GOAL",
        "move_base_msgs/msg/MoveBaseActionFeedback": f"{_HERE}.move_base:FEEDBACK",
        "move_base_msgs/msg/MoveBaseActionResult": f"{_HERE}.move_base:RESULT",
        "mbf_msgs/msg/MoveBaseActionGoal": f"{_HERE}.move_base:GOAL",
        "mbf_msgs/msg/MoveBaseActionResult": f"{_HERE}.move_base:RESULT",
        "mbf_msgs/msg/ExePathActionResult": f"{_HERE}.move_base:PATH_RESULT",
        "mbf_msgs/msg/RecoveryActionGoal": f"{_HERE}.move_base:RECOVERY_GOAL",
        "mbf_msgs/msg/RecoveryActionResult": f"{_HERE}.move_base:RECOVERY_RESULT",
        "diagnostic_msgs/msg/DiagnosticArray": f"{_HERE}.health:DIAGNOSTICS",
        "diagnostic_msgs/msg/DiagnosticStatus": f"{_HERE}.health:DIAGNOSTIC_STATUS",
        "sensor_msgs/msg/BatteryState": f"{_HERE}.battery:BATTERY_STATE",
        "rcl_interfaces/msg/ParameterEvent": f"{_HERE}.parameters:PARAMETER_EVENT",
        "dynamic_reconfigure/msg/Config": f"{_HERE}.parameters:RECONFIGURE",
        "lifecycle_msgs/msg/TransitionEvent": f"{_HERE}.lifecycle:TRANSITION_EVENT",
        "rtabmap_msgs/msg/Info": f"{_HERE}.closures:RTABMAP_INFO",
        "rtabmap_ros/msg/Info": f"{_HERE}.closures:RTABMAP_INFO",
        "visualization_msgs/msg/MarkerArray": f"{_HERE}.graph_markers:GRAPH_MARKERS",
        "rosgraph_msgs/msg/Clock": f"{_HERE}.clock:CLOCK",
        "rcl_interfaces/msg/Log": f"{_HERE}.health:LOG",
        "rosgraph_msgs/msg/Log": f"{_HERE}.health:LOG",
        "foxglove_msgs/msg/PoseInFrame": f"{_HERE}.foxglove:POSE_IN_FRAME",
        "foxglove_msgs/msg/PosesInFrame": f"{_HERE}.foxglove:POSES_IN_FRAME",
        "foxglove_msgs/msg/FrameTransform": f"{_HERE}.foxglove:FRAME_TRANSFORM",
        "foxglove_msgs/msg/FrameTransforms": f"{_HERE}.foxglove:FRAME_TRANSFORMS",
        "foxglove_msgs/msg/Odometry": f"{_HERE}.foxglove:ODOMETRY",
        "foxglove_msgs/msg/LaserScan": f"{_HERE}.foxglove_scan:LASER_SCAN",
        "foxglove_msgs/msg/PointCloud": f"{_HERE}.foxglove_points:POINT_CLOUD",
        "foxglove_msgs/msg/Grid": f"{_HERE}.foxglove_grid:GRID",
        "foxglove_msgs/msg/LocationFix": f"{_HERE}.foxglove:LOCATION_FIX",
        "foxglove_msgs/msg/LocationFixes": f"{_HERE}.foxglove:LOCATION_FIXES",
        "foxglove_msgs/msg/Log": f"{_HERE}.foxglove:LOG",
    },
)

callable_stage(__name__)
