"""Layouts of what SLAM systems tell of themselves that no type store has (introlab/rtabmap_ros)."""

from __future__ import annotations

#: Type name ("package/msg/Name") to its fields, one per line.
SLAM: dict[str, str] = {
    "rtabmap_msgs/msg/Link": (
        "int32 from_id\n"
        "int32 to_id\n"
        "int32 type\n"
        "geometry_msgs/Transform transform\n"
        "float64[36] information\n"
    ),
    "rtabmap_msgs/msg/MapGraph": (
        "std_msgs/Header header\n"
        "geometry_msgs/Transform map_to_odom\n"
        "int32[] poses_id\n"
        "geometry_msgs/Pose[] poses\n"
        "rtabmap_msgs/Link[] links\n"
    ),
    "rtabmap_msgs/msg/Info": (
        "std_msgs/Header header\n"
        "int32 ref_id\n"
        "int32 loop_closure_id\n"
        "int32 proximity_detection_id\n"
        "int32 landmark_id\n"
        "geometry_msgs/Transform loop_closure_transform\n"
        "int32[] wm_state\n"
        "int32[] posterior_keys\n"
        "float32[] posterior_values\n"
        "int32[] likelihood_keys\n"
        "float32[] likelihood_values\n"
        "int32[] raw_likelihood_keys\n"
        "float32[] raw_likelihood_values\n"
        "int32[] weights_keys\n"
        "int32[] weights_values\n"
        "int32[] labels_keys\n"
        "string[] labels_values\n"
        "string[] stats_keys\n"
        "float32[] stats_values\n"
        "int32[] local_path\n"
        "int32 current_goal_id\n"
        "rtabmap_msgs/MapGraph odom_cache\n"
    ),
    # Of ROS 1, whose bags carry their own, newer or older definition.
    "rtabmap_ros/msg/Info": (
        "std_msgs/Header header\n"
        "int32 refId\n"
        "int32 loopClosureId\n"
        "int32 proximityDetectionId\n"
        "geometry_msgs/Transform loopClosureTransform\n"
        "int32[] posteriorKeys\n"
        "float32[] posteriorValues\n"
        "int32[] likelihoodKeys\n"
        "float32[] likelihoodValues\n"
        "int32[] rawLikelihoodKeys\n"
        "float32[] rawLikelihoodValues\n"
        "int32[] weightsKeys\n"
        "int32[] weightsValues\n"
        "string[] statsKeys\n"
        "float32[] statsValues\n"
        "int32[] localPath\n"
        "int32 currentGoalId\n"
    ),
}
