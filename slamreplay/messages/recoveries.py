"""Layouts of what navigators say of their goals and recoveries, of ROS 1 and of ROS 2.

`RECOVERIES` are messages. `INTERFACES` are services and actions, whose messages rosidl derives
(`slamreplay.messages.interfaces`); each has its layouts newest first, under the first release
that has it. Only what differs on the wire counts: goals and results travel in topics since action
introspection (Kilted), so of the layouts before only the feedback is told apart.

Sources: ros-navigation/navigation2 (nav2_msgs), open-navigation/opennav_docking,
ros2/rcl_interfaces (service_msgs), ros2/common_interfaces (nav_msgs, std_srvs),
ros-planning/navigation_msgs (move_base_msgs), magazino/move_base_flex (mbf_msgs), ros/actionlib
(what genaction.py makes of an action).
"""

from __future__ import annotations

_ACTION_GOAL = "std_msgs/Header header\nactionlib_msgs/GoalID goal_id\n"
_ACTION_STATUS = "std_msgs/Header header\nactionlib_msgs/GoalStatus status\n"

#: Messages: type name to its fields, one per line.
RECOVERIES: dict[str, str] = {
    "service_msgs/msg/ServiceEventInfo": (
        "uint8 event_type\n"
        "builtin_interfaces/Time stamp\n"
        "uint8[16] client_gid\n"  # declared char[16]: the same bytes
        "int64 sequence_number\n"
    ),
    "nav_msgs/msg/Goals": "std_msgs/Header header\ngeometry_msgs/PoseStamped[] goals\n",
    "nav2_msgs/msg/WaypointStatus": (
        "uint8 waypoint_status\n"
        "uint32 waypoint_index\n"
        "geometry_msgs/PoseStamped waypoint_pose\n"
        "uint16 error_code\n"
        "string error_msg\n"
    ),
    "nav2_msgs/msg/CollisionMonitorState": "uint8 action_type\nstring polygon_name\n",
    "nav2_msgs/msg/CollisionDetectorState": "string[] polygons\nbool[] detections\n",
    "nav2_msgs/msg/SpeedLimit": ("std_msgs/Header header\nbool percentage\nfloat64 speed_limit\n"),
    "move_base_msgs/msg/MoveBaseGoal": "geometry_msgs/PoseStamped target_pose\n",
    "move_base_msgs/msg/MoveBaseFeedback": "geometry_msgs/PoseStamped base_position\n",
    "move_base_msgs/msg/MoveBaseResult": "",
    "move_base_msgs/msg/MoveBaseActionGoal": f"{_ACTION_GOAL}move_base_msgs/MoveBaseGoal goal\n",
    "move_base_msgs/msg/MoveBaseActionFeedback": (
        f"{_ACTION_STATUS}move_base_msgs/MoveBaseFeedback feedback\n"
    ),
    "move_base_msgs/msg/MoveBaseActionResult": (
        f"{_ACTION_STATUS}move_base_msgs/MoveBaseResult result\n"
    ),
    "mbf_msgs/msg/RecoveryFeedback": "",
    "mbf_msgs/msg/RecoveryActionGoal": f"{_ACTION_GOAL}mbf_msgs/RecoveryGoal goal\n",
    "mbf_msgs/msg/RecoveryActionFeedback": f"{_ACTION_STATUS}mbf_msgs/RecoveryFeedback feedback\n",
    "mbf_msgs/msg/RecoveryActionResult": f"{_ACTION_STATUS}mbf_msgs/RecoveryResult result\n",
    "mbf_msgs/msg/MoveBaseGoal": (
        "geometry_msgs/PoseStamped target_pose\n"
        "string controller\n"
        "string planner\n"
        "string[] recovery_behaviors\n"
    ),
    "mbf_msgs/msg/MoveBaseResult": (
        "uint32 outcome\n"
        "string message\n"
        "float32 dist_to_goal\n"
        "float32 angle_to_goal\n"
        "geometry_msgs/PoseStamped final_pose\n"
    ),
    "mbf_msgs/msg/MoveBaseActionGoal": f"{_ACTION_GOAL}mbf_msgs/MoveBaseGoal goal\n",
    "mbf_msgs/msg/MoveBaseActionResult": f"{_ACTION_STATUS}mbf_msgs/MoveBaseResult result\n",
    "mbf_msgs/msg/ExePathResult": (
        "uint32 outcome\n"
        "string message\n"
        "geometry_msgs/PoseStamped final_pose\n"
        "float32 dist_to_goal\n"
        "float32 angle_to_goal\n"
    ),
    "mbf_msgs/msg/ExePathActionResult": f"{_ACTION_STATUS}mbf_msgs/ExePathResult result\n",
}

#: Newer layouts of the same names.
LATER_RECOVERIES: dict[str, str] = {
    "nav2_msgs/msg/CollisionMonitorState": (
        "std_msgs/Header header\nuint8 action_type\nstring polygon_name\n"
    ),
}

_PROGRESS = (
    "geometry_msgs/PoseStamped current_pose\n"
    "builtin_interfaces/Duration navigation_time\n"
    "builtin_interfaces/Duration estimated_time_remaining\n"
    "int16 number_of_recoveries\n"
    "float32 distance_remaining\n"
)
_TRACKING = "float32 position_tracking_error\nfloat32 heading_tracking_error\n"
_ENDED = "uint16 error_code\nstring error_msg\n"
_TOOK = f"builtin_interfaces/Duration total_elapsed_time\n{_ENDED}"
_WAYPOINTS = "nav2_msgs/WaypointStatus[] waypoint_statuses\n"
_TO_POSE = f"geometry_msgs/PoseStamped pose\nstring behavior_tree\n---\n{_ENDED}---\n"
_THROUGH_POSES = f"nav_msgs/Goals poses\nstring behavior_tree\n---\n{_ENDED}{_WAYPOINTS}---\n"
_DRIVE = (
    "geometry_msgs/Point target\n"
    "float32 speed\n"
    "builtin_interfaces/Duration time_allowance\n"
    "bool disable_collision_checks\n"
    f"---\n{_TOOK}---\n"
    "float32 distance_traveled\n"
)
_DOCK = (
    "bool use_dock_id\n"
    "string dock_id\n"
    "geometry_msgs/PoseStamped dock_pose\n"
    "string dock_type\n"
    "float32 max_staging_time\n"
    "bool navigate_to_staging_pose\n"
    "---\nbool success\nuint16 error_code\nuint16 num_retries\nstring error_msg\n---\n"
    "uint16 state\n"
    "builtin_interfaces/Duration docking_time\n"
    "uint16 num_retries\n"
)
_NOTHING = "---\nstd_msgs/Empty response\n"
_SUCCESS = "---\nbool success\n"

#: Services and actions: name to first release to the text of the file.
INTERFACES: dict[str, dict[str, str]] = {
    "nav2_msgs/srv/ClearEntireCostmap": {
        "lyrical": f"std_msgs/Empty request\nstring[] plugins\n{_SUCCESS}",
        "foxy": f"std_msgs/Empty request\n{_NOTHING}",
    },
    "nav2_msgs/srv/ClearCostmapAroundRobot": {
        "lyrical": f"float32 reset_distance\nstring[] plugins\n{_SUCCESS}",
        "foxy": f"float32 reset_distance\n{_NOTHING}",
    },
    "nav2_msgs/srv/ClearCostmapExceptRegion": {
        "lyrical": f"float32 reset_distance\nstring[] plugins\n{_SUCCESS}",
        "foxy": f"float32 reset_distance\n{_NOTHING}",
    },
    "nav2_msgs/srv/ClearCostmapAroundPose": {
        "lyrical": (
            "geometry_msgs/PoseStamped pose\nfloat64 reset_distance\nstring[] plugins\n" + _SUCCESS
        ),
        "jazzy": f"geometry_msgs/PoseStamped pose\nfloat64 reset_distance\n{_NOTHING}",
    },
    "std_srvs/srv/Empty": {"foxy": "---\n"},
    "nav2_msgs/srv/SetInitialPose": {
        "foxy": "geometry_msgs/PoseWithCovarianceStamped pose\n---\n",
    },
    "nav2_msgs/action/Spin": {
        "foxy": (
            "float32 target_yaw\n"
            "builtin_interfaces/Duration time_allowance\n"
            "bool disable_collision_checks\n"
            f"---\n{_TOOK}---\n"
            "float32 angular_distance_traveled\n"
        ),
    },
    "nav2_msgs/action/BackUp": {"foxy": _DRIVE},
    "nav2_msgs/action/DriveOnHeading": {"humble": _DRIVE},
    "nav2_msgs/action/Wait": {
        "foxy": (
            f"builtin_interfaces/Duration time\n---\n{_TOOK}---\n"
            "builtin_interfaces/Duration time_left\n"
        ),
    },
    "nav2_msgs/action/AssistedTeleop": {
        "humble": (
            f"builtin_interfaces/Duration time_allowance\n---\n{_TOOK}---\n"
            "builtin_interfaces/Duration current_teleop_duration\n"
        ),
    },
    "nav2_msgs/action/NavigateToPose": {
        "lyrical": f"{_TO_POSE}{_PROGRESS}{_TRACKING}",
        "galactic": f"{_TO_POSE}{_PROGRESS}",
        "foxy": _TO_POSE + _PROGRESS.replace(
            "builtin_interfaces/Duration estimated_time_remaining\n", ""
        ),
    },
    "nav2_msgs/action/NavigateThroughPoses": {
        "lyrical": (
            f"{_THROUGH_POSES}{_PROGRESS}{_TRACKING}int16 number_of_poses_remaining\n{_WAYPOINTS}"
        ),
        "kilted": f"{_THROUGH_POSES}{_PROGRESS}int16 number_of_poses_remaining\n{_WAYPOINTS}",
        "galactic": f"{_THROUGH_POSES}{_PROGRESS}int16 number_of_poses_remaining\n",
    },
    "nav2_msgs/action/DockRobot": {"jazzy": _DOCK},
    "opennav_docking_msgs/action/DockRobot": {"humble": _DOCK},
}  # fmt: skip
