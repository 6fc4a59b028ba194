"""Layouts of message types that logs of mobile robots hold and that no type store of rosbags has.

Recorders since ROS 2 Iron, MCAP and ROS 1 bags carry the definitions of their types; a db3 of
Humble or older does not, and then these are used. Only types, names and order of fields matter to
a decoder, so comments and constants are left out. Written in ROS 2 spelling, which ROS 1 stores
understand too (`std_msgs/Header` is whatever the store says it is).

Sources: ros-navigation/navigation2 (nav2_msgs), ros-planning/navigation_msgs (map_msgs,
move_base_msgs), christianrauch/apriltag_msgs, AprilRobotics/apriltag_ros,
UbiquityRobotics/fiducials, magazino/move_base_flex.
"""

from __future__ import annotations

from slamreplay.messages.drives import DRIVES
from slamreplay.messages.foxglove import FOXGLOVE_DEFINITIONS
from slamreplay.messages.recoveries import LATER_RECOVERIES, RECOVERIES
from slamreplay.messages.signals import SIGNALS
from slamreplay.messages.slam import SLAM
from slamreplay.messages.tags import TAGS

#: Type name ("package/msg/Name") to its fields, one per line.
DEFINITIONS: dict[str, str] = {
    # Behaviour tree: Humble's layout, which has no `uid`; see LATER_DEFINITIONS.
    "nav2_msgs/msg/BehaviorTreeStatusChange": (
        "builtin_interfaces/Time timestamp\n"
        "string node_name\n"
        "string previous_status\n"
        "string current_status\n"
    ),
    "nav2_msgs/msg/BehaviorTreeLog": (
        "builtin_interfaces/Time timestamp\nnav2_msgs/BehaviorTreeStatusChange[] event_log\n"
    ),
    "nav2_msgs/msg/Particle": "geometry_msgs/Pose pose\nfloat64 weight\n",
    "nav2_msgs/msg/ParticleCloud": "std_msgs/Header header\nnav2_msgs/Particle[] particles\n",
    "nav2_msgs/msg/CostmapMetaData": (
        "builtin_interfaces/Time map_load_time\n"
        "builtin_interfaces/Time update_time\n"
        "string layer\n"
        "float32 resolution\n"
        "uint32 size_x\n"
        "uint32 size_y\n"
        "geometry_msgs/Pose origin\n"
    ),
    "nav2_msgs/msg/Costmap": (
        "std_msgs/Header header\nnav2_msgs/CostmapMetaData metadata\nuint8[] data\n"
    ),
    # Also declared int8[] by some releases; the bytes are the same costs 0 to 255.
    "nav2_msgs/msg/CostmapUpdate": (
        "std_msgs/Header header\nuint32 x\nuint32 y\nuint32 size_x\nuint32 size_y\nuint8[] data\n"
    ),
    "map_msgs/msg/OccupancyGridUpdate": (
        "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
    ),
    "move_base_msgs/msg/RecoveryStatus": (
        "geometry_msgs/PoseStamped pose_stamped\n"
        "int16 current_recovery_number\n"
        "int16 total_number_of_recoveries\n"
        "string recovery_behavior_name\n"
    ),
    "mbf_msgs/msg/MoveBaseFeedback": (
        "uint32 outcome\n"
        "string message\n"
        "float32 dist_to_goal\n"
        "float32 angle_to_goal\n"
        "geometry_msgs/PoseStamped current_pose\n"
        "geometry_msgs/TwistStamped last_cmd_vel\n"
    ),
    "mbf_msgs/msg/RecoveryGoal": "string behavior\nuint8 concurrency_slot\n",
    "mbf_msgs/msg/RecoveryResult": "uint32 outcome\nstring message\nstring used_plugin\n",
    "apriltag_msgs/msg/Point": "float64 x\nfloat64 y\n",
    "apriltag_msgs/msg/AprilTagDetection": (
        "string family\n"
        "int32 id\n"
        "int32 hamming\n"
        "float32 goodness\n"
        "float32 decision_margin\n"
        "apriltag_msgs/Point centre\n"
        "apriltag_msgs/Point[4] corners\n"
        "float64[9] homography\n"
    ),
    "apriltag_msgs/msg/AprilTagDetectionArray": (
        "std_msgs/Header header\napriltag_msgs/AprilTagDetection[] detections\n"
    ),
    "apriltag_ros/msg/AprilTagDetection": (
        "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose\n"
    ),
    "apriltag_ros/msg/AprilTagDetectionArray": (
        "std_msgs/Header header\napriltag_ros/AprilTagDetection[] detections\n"
    ),
    "fiducial_msgs/msg/Fiducial": (
        "int32 fiducial_id\n"
        "int32 direction\n"
        "float64 x0\n"
        "float64 y0\n"
        "float64 x1\n"
        "float64 y1\n"
        "float64 x2\n"
        "float64 y2\n"
        "float64 x3\n"
        "float64 y3\n"
    ),
    "fiducial_msgs/msg/FiducialArray": (
        "std_msgs/Header header\nint32 image_seq\nfiducial_msgs/Fiducial[] fiducials\n"
    ),
    # Newer sources append `bool detected`; see LATER_DEFINITIONS.
    "fiducial_msgs/msg/FiducialTransform": (
        "int32 fiducial_id\n"
        "geometry_msgs/Transform transform\n"
        "float64 image_error\n"
        "float64 object_error\n"
        "float64 fiducial_area\n"
    ),
    "fiducial_msgs/msg/FiducialTransformArray": (
        "std_msgs/Header header\nint32 image_seq\nfiducial_msgs/FiducialTransform[] transforms\n"
    ),
    # tf of ROS 1: the store of Noetic has neither name.
    "tf/msg/tfMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    **DRIVES,
    **FOXGLOVE_DEFINITIONS,
    **RECOVERIES,
    **SIGNALS,
    **SLAM,
    **TAGS,
}

#: Newer layouts of the same names; a log that has them says so in its own definitions.
LATER_DEFINITIONS: dict[str, str] = {
    "nav2_msgs/msg/BehaviorTreeStatusChange": (
        "builtin_interfaces/Time timestamp\n"
        "string node_name\n"
        "uint16 uid\n"
        "string previous_status\n"
        "string current_status\n"
    ),
    "fiducial_msgs/msg/FiducialTransform": (
        "int32 fiducial_id\n"
        "geometry_msgs/Transform transform\n"
        "float64 image_error\n"
        "float64 object_error\n"
        "float64 fiducial_area\n"
        "bool detected\n"
    ),
    **LATER_RECOVERIES,
}
