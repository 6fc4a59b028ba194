"""Layouts of tag and landmark detections that no type store has.

Sources: NVIDIA-ISAAC-ROS/isaac_ros_common, pal-robotics/aruco_ros, JMU-ROBOTICS-VIVA/ros2_aruco,
AIRLab-POLIMI/ros2-aruco-pose-estimation, ros-perception/ar_track_alvar,
cartographer-project/cartographer_ros.
"""

from __future__ import annotations

_ARUCO_LISTS = "std_msgs/Header header\nint64[] marker_ids\ngeometry_msgs/Pose[] poses\n"

#: Type name ("package/msg/Name") to its fields, one per line.
TAGS: dict[str, str] = {
    "isaac_ros_apriltag_interfaces/msg/AprilTagDetection": (
        "string family\n"
        "int32 id\n"
        "geometry_msgs/Point center\n"
        "geometry_msgs/Point[4] corners\n"
        "geometry_msgs/PoseWithCovarianceStamped pose\n"
    ),
    "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray": (
        "std_msgs/Header header\nisaac_ros_apriltag_interfaces/AprilTagDetection[] detections\n"
    ),
    "aruco_msgs/msg/Marker": (
        "std_msgs/Header header\n"
        "uint32 id\n"
        "geometry_msgs/PoseWithCovariance pose\n"
        "float64 confidence\n"
    ),
    "aruco_msgs/msg/MarkerArray": "std_msgs/Header header\naruco_msgs/Marker[] markers\n",
    # Some forks append pixel_centers; a log that has them says so in its own definitions.
    "ros2_aruco_interfaces/msg/ArucoMarkers": _ARUCO_LISTS,
    "aruco_interfaces/msg/ArucoMarkers": _ARUCO_LISTS,
    "ar_track_alvar_msgs/msg/AlvarMarker": (
        "std_msgs/Header header\nuint32 id\nuint32 confidence\ngeometry_msgs/PoseStamped pose\n"
    ),
    "ar_track_alvar_msgs/msg/AlvarMarkers": (
        "std_msgs/Header header\nar_track_alvar_msgs/AlvarMarker[] markers\n"
    ),
    "cartographer_ros_msgs/msg/LandmarkEntry": (
        "string id\n"
        "geometry_msgs/Pose tracking_from_landmark_transform\n"
        "float64 translation_weight\n"
        "float64 rotation_weight\n"
    ),
    "cartographer_ros_msgs/msg/LandmarkList": (
        "std_msgs/Header header\ncartographer_ros_msgs/LandmarkEntry[] landmark\n"
    ),
}
