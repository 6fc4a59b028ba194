"""Foxglove's schemas as ROS 2 has them (package foxglove_msgs), the spelling all encodings share.

The fields of JSON and protobuf messages are looked for by these names, and a log in ROS's own
encoding that brings no definitions is read by them. Constants are there because JSON may name an
enum's value. LocationFix is the layout of Humble's time; later ones append fields to it.

Source: foxglove/foxglove-sdk, schemas/ros2.
"""

from __future__ import annotations

#: What a schema's name starts with in JSON and protobuf ("foxglove.LaserScan"), and in ROS.
SCHEMA_PREFIX, TYPE_PREFIX = "foxglove.", "foxglove_msgs/msg/"

_STAMPED = "builtin_interfaces/Time timestamp\nstring frame_id\n"
_PACKED = "foxglove_msgs/PackedElementField[] fields\nuint8[] data\n"

#: Type name ("package/msg/Name") to its fields, one per line.
FOXGLOVE_DEFINITIONS: dict[str, str] = {
    "foxglove_msgs/msg/Vector2": "float64 x\nfloat64 y\n",
    "foxglove_msgs/msg/KeyValuePair": "string key\nstring value\n",
    "foxglove_msgs/msg/PackedElementField": (
        "uint8 UNKNOWN=0\n"
        "uint8 UINT8=1\n"
        "uint8 INT8=2\n"
        "uint8 UINT16=3\n"
        "uint8 INT16=4\n"
        "uint8 UINT32=5\n"
        "uint8 INT32=6\n"
        "uint8 FLOAT32=7\n"
        "uint8 FLOAT64=8\n"
        "string name\n"
        "uint32 offset\n"
        "uint8 type\n"
    ),
    "foxglove_msgs/msg/PoseInFrame": f"{_STAMPED}geometry_msgs/Pose pose\n",
    "foxglove_msgs/msg/PosesInFrame": f"{_STAMPED}geometry_msgs/Pose[] poses\n",
    "foxglove_msgs/msg/FrameTransform": (
        "builtin_interfaces/Time timestamp\n"
        "string parent_frame_id\n"
        "string child_frame_id\n"
        "geometry_msgs/Vector3 translation\n"
        "geometry_msgs/Quaternion rotation\n"
    ),
    "foxglove_msgs/msg/FrameTransforms": "foxglove_msgs/FrameTransform[] transforms\n",
    "foxglove_msgs/msg/LaserScan": (
        f"{_STAMPED}"
        "geometry_msgs/Pose pose\n"
        "float64 start_angle\n"
        "float64 end_angle\n"
        "float64[] ranges\n"
        "float64[] intensities\n"
    ),
    "foxglove_msgs/msg/Grid": (
        f"{_STAMPED}"
        "geometry_msgs/Pose pose\n"
        "uint32 column_count\n"
        "foxglove_msgs/Vector2 cell_size\n"
        "uint32 row_stride\n"
        "uint32 cell_stride\n"
        f"{_PACKED}"
    ),
    "foxglove_msgs/msg/PointCloud": (
        f"{_STAMPED}geometry_msgs/Pose pose\nuint32 point_stride\n{_PACKED}"
    ),
    "foxglove_msgs/msg/LocationFix": (
        f"{_STAMPED}"
        "float64 latitude\n"
        "float64 longitude\n"
        "float64 altitude\n"
        "float64[9] position_covariance\n"
        "uint8 UNKNOWN=0\n"
        "uint8 APPROXIMATED=1\n"
        "uint8 DIAGONAL_KNOWN=2\n"
        "uint8 KNOWN=3\n"
        "uint8 position_covariance_type\n"
    ),
    "foxglove_msgs/msg/LocationFixes": "foxglove_msgs/LocationFix[] fixes\n",
    "foxglove_msgs/msg/Odometry": (
        f"{_STAMPED}"
        "string body_frame_id\n"
        "geometry_msgs/Pose pose\n"
        "geometry_msgs/Vector3 linear_velocity\n"
        "geometry_msgs/Vector3 angular_velocity\n"
        "float64[36] pose_covariance\n"
        "float64[36] velocity_covariance\n"
        "foxglove_msgs/KeyValuePair[] metadata\n"
    ),
    "foxglove_msgs/msg/Log": (
        "builtin_interfaces/Time timestamp\n"
        "uint8 UNKNOWN=0\n"
        "uint8 DEBUG=1\n"
        "uint8 INFO=2\n"
        "uint8 WARNING=3\n"
        "uint8 ERROR=4\n"
        "uint8 FATAL=5\n"
        "uint8 level\n"
        "string message\n"
        "string name\n"
        "string file\n"
        "uint32 line\n"
    ),
}
