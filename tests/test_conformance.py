"""Every registered estimator, perturbation and decoder keeps its contract: one line each."""

from functools import partial

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from slamreplay.estimators import ESTIMATORS
from slamreplay.ingest import DECODERS
from slamreplay.perturb import PERTURBATIONS
from slamreplay.testing import check_decoder, check_estimator, check_noise, check_perturbation
from slamreplay.testing.decoders import check_payload
from slamreplay.testing.edits import with_maps
from slamreplay.testing.matched import WorldNoise, noisy_bundle
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle

#: Name, and by how much sampling noise lets its poses miss a moved map frame: m, rad.
ESTIMATOR_LINES = {
    "amcl": (0.25, 0.15),
    "dead_reckoning": (1e-6, 1e-6),
    "ekf": (1e-6, 1e-6),
    "ekf_tuned": (1e-3, 1e-3),
    "pose_graph": (0.02, 0.01),
    "pose_graph_online": (0.02, 0.01),
    "fiducial_grid": (1e-6, 1e-6),
    "recorded": (1e-6, 1e-6),
    "recorded_pose": (1e-6, 1e-6),
    "recorded_tf": (1e-6, 1e-6),
    "scan_matching": (1e-6, 1e-6),
}

#: Those that close loops are shown a lap and a half.
LAPS_S = {"pose_graph": 60.0, "pose_graph_online": 60.0}

#: Worlds whose noise is that of an estimator, where tags and odometry are not as by default.
WORLDS = {
    "fiducial_grid": partial(
        noisy_bundle,
        noise=WorldNoise(range_m=0.005, range_per_m=0.02, bearing_rad=0.02, heading_rad=0.01),
    ),
}

PERTURBATION_LINES = (
    "beam_drop",
    "clock_skew",
    "frame_swap",
    "gyro_bias",
    "handedness",
    "imu_drop",
    "initial_pose",
    "laser_extrinsic",
    "map_edit",
    "map_rotate",
    "map_shift",
    "map_stale",
    "max_range",
    "measurement_noise_scale",
    "min_score",
    "odometry_drop",
    "odometry_noise",
    "odometry_scale",
    "odometry_slip",
    "particle_count",
    "people",
    "pose_covariance_scale",
    "process_noise_scale",
    "quaternion_order",
    "range_bias",
    "range_noise",
    "scan_delay",
    "scan_drop",
    "stamp_jitter",
    "tf_delay",
    "unit_error",
)


def redrawn_bundle():
    """A log in which the map was drawn anew once, a little otherwise."""
    old, new = room_grid(), room_grid().cells.copy()
    new[60:64, 20:24] = 100
    new = type(old)(new, old.resolution_m, old.origin_xyyaw)
    bundle = synthetic_bundle(seconds=24.0)
    return with_maps(bundle, [(START_NS, old), (START_NS + 12_000_000_000, new)])


#: Evidence and levels of those that need others than usual.
PERTURBED = {"map_stale": redrawn_bundle}
PERTURBED_BY = {"map_stale": {"versions": 1.0, "age": 30.0}}

STAMP = {"sec": 3, "nanosec": 4}
HEADER = {"stamp": STAMP, "frame_id": "/f"}
T = 3_000_000_004
XYZ = {"x": 1.0, "y": 2.0, "z": 3.0}
TURN = {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}
YAW = 2 * np.arctan2(0.6, 0.8)
POSE = {"position": XYZ, "orientation": TURN}
COV36, COV9 = tuple(map(float, range(36))), tuple(map(float, range(9)))  # of fixed length
TWIST = {"linear": XYZ, "angular": {"x": 4.0, "y": 5.0, "z": 6.0}}
PLACED = {"position_xyz": [1, 2, 3], "orientation_xyzw": [0, 0, 0.6, 0.8], "frame_id": "f"}
POSED = {"pose": POSE, "covariance": COV36}
LOG = {"level": 4, "name": "n", "msg": "text"}
GRID = {"resolution": 0.5, "width": 2, "height": 1, "origin": POSE}
COSTS = {"resolution": 0.5, "size_x": 2, "size_y": 1, "origin": POSE}
VOXELS = {
    "data": [0x00040004, 0x0000FFFB, 0x0000FFFF, 0xFFF80007],  # marked, one known, none, above it
    "origin": XYZ,
    "resolutions": {"x": 0.5, "y": 0.5, "z": 0.2},
    "size_x": 4,
    "size_y": 1,
    "size_z": 3,
}
SEEN_FROM_ABOVE = {"cells": [100, 0, -1, -1], "width": 4, "origin_xyyaw": [1, 2, 0]}
FIELDS = [{"name": n, "offset": 4 * k, "datatype": 7} for k, n in enumerate("xyz")]
CLOUD = {"height": 1, "width": 1, "fields": FIELDS, "is_bigendian": False, "point_step": 12}
XYZ_BYTES = list(np.array([1, 2, 3], dtype="<f4").tobytes())
TF = {"header": HEADER, "child_frame_id": "c", "transform": {"translation": XYZ, "rotation": TURN}}
EDGE = {"parent_frame": "f", "child_frame": "c", "translation_xyz": [1, 2, 3], "is_static": False}
SPIN = {
    "timestamp": STAMP,
    "node_name": "Spin",
    "previous_status": "IDLE",
    "current_status": "RUNNING",
}
ANGLES = {"angle_min": -1.0, "angle_max": 1.0, "angle_increment": 1.0, "time_increment": 0.25}
SCAN = {**ANGLES, "scan_time": 0.5, "range_min": 0.1, "range_max": 9.0, "intensities": []}
IMU = {"orientation": TURN, "angular_velocity": XYZ, "linear_acceleration": XYZ}
IMU_COV = {f"{name}_covariance": COV9 for name in IMU}
ERRORS = {"image_error": 0.1, "object_error": 0.1, "fiducial_area": 9.0}
PLAIN_STAMP = {"timestamp": STAMP, "frame_id": "/f"}
FOX_EDGE = {
    "timestamp": STAMP,
    "parent_frame_id": "/f",
    "child_frame_id": "c",
    "translation": XYZ,
    "rotation": TURN,
}
FOX_FIX = {
    **PLAIN_STAMP,
    "latitude": 48.0,
    "longitude": 0.0,
    "altitude": 3.0,
    "position_covariance": COV9,
    "position_covariance_type": 0,
}
FOX_FIX_ROW = {"frame_id": "earth", "child_frame_id": "f", "kind": "gnss"}
UNTURNED = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": dict.fromkeys("xyzw", 0.0)}
PACKED = [{"name": n, "offset": 4 * k, "type": 7} for k, n in enumerate("xyz")]
VELOCITY = {"linear_velocity_xyz": [1, 2, 3], "angular_velocity_xyz": [4, 5, 6]}
MARKER = {"header": HEADER, "id": 7, "pose": POSED, "confidence": 1.0}
NODE = {"header": HEADER, "ns": "slam_toolbox", "type": 2, "action": 0, "points": []}
DRIVE = {"speed": 1.5, "steering_angle": 0.2}
DRIVEN = {"linear_velocity_xyz": [1.5, 0, 0], "angular_velocity_xyz": [0, 0, np.nan]}
UUID, OTHER = {"uuid": (7,) * 16}, {"uuid": (8,) * 16}
NO_GOALS = {"status_list": []}
GOAL_ID = {"stamp": STAMP, "id": "g"}
GOAL = {"goal_info": {"goal_id": UUID, "stamp": STAMP}, "status": 6}
PROGRESS = {"current_pose": {"header": HEADER, "pose": POSE}}
ENDED = {"header": HEADER, "status": {"goal_id": GOAL_ID, "status": 3, "text": ""}}
MBF_ENDED = {"dist_to_goal": 0.5, "angle_to_goal": 0.5}
TARGET = {"target_pose": {"header": HEADER, "pose": POSE}}


def feedback(goal_id, **fields):
    return {"goal_id": goal_id, "feedback": fields}


def event(number, request=(), response=(), kind=1):
    info = {"event_type": kind, "stamp": STAMP, "client_gid": (9,) * 16, "sequence_number": number}
    return {"info": info, "request": list(request), "response": list(response)}


def behaviour(action):
    row = {"name": "spin", "status": "executing", "goal": "07" * 16, "source": "action"}
    return (
        feedback(UUID),
        row,
        None,
        {"topic": "/r/spin/_action/feedback", "after": feedback(OTHER)},
    )


def counted(field, row, **fields):
    now, before = (feedback(UUID, **fields, **{field: n}) for n in (2, 1))
    return now, row, None if "source" not in row else T, {"after": before}


def sent(action):
    row = {"name": "spin", "status": "pending", "goal": "07" * 16, "source": "action"}
    topic = "/spin/_action/send_goal/_service_event"
    request = event(1, [{"goal_id": UUID}])
    return request, row, T, {"topic": topic, "after": event(2, [{"goal_id": OTHER}])}


def cleared(service):
    row = {"name": "clear_all", "status": "running", "source": "service"}
    extra = {"topic": "/costmap/clear_all/_service_event", "after": event(2)}
    return event(1), row, T, extra


#: Message type: the fields of one message, what its first row holds, and its stamp; where it takes
#: more than one message of any topic to make a row, also the topic and the message before.
DECODER_LINES = {
    "nav_msgs/msg/Odometry": (
        {
            "header": HEADER,
            "child_frame_id": "/b",
            "pose": POSED,
            "twist": {"twist": TWIST, "covariance": COV36},
        },
        {**PLACED, **VELOCITY, "child_frame_id": "b", "pose_covariance": COV36},
        T,
    ),
    "sensor_msgs/msg/Imu": (
        {"header": HEADER, **IMU, **IMU_COV},
        {"orientation_xyzw": [0, 0, 0.6, 0.8], "angular_velocity_xyz": [1, 2, 3]},
        T,
    ),
    "sensor_msgs/msg/LaserScan": (
        {"header": HEADER, **SCAN, "ranges": [1.0, float("inf"), 0.0]},
        {"ranges_m": [1, np.inf, 0], "angle_min_rad": -1, "range_max_m": 9},
        T,
    ),
    "sensor_msgs/msg/MultiEchoLaserScan": (
        {"header": HEADER, **SCAN, "ranges": [{"echoes": [2.0, 3.0]}, {"echoes": []}]},
        {"ranges_m": [2, np.nan], "angle_min_rad": -1, "frame_id": "f"},
        T,
    ),
    "sensor_msgs/msg/PointCloud": (
        {"header": HEADER, "points": [XYZ], "channels": []},
        {"points_xyz": [1, 2, 3], "frame_id": "f"},
        T,
    ),
    "sensor_msgs/msg/PointCloud2": (
        {"header": HEADER, **CLOUD, "row_step": 12, "data": XYZ_BYTES},
        {"points_xyz": [1, 2, 3]},
        T,
    ),
    "geometry_msgs/msg/PoseWithCovarianceStamped": (
        {"header": HEADER, "pose": POSED},
        {**PLACED, "covariance": COV36},
        T,
    ),
    "geometry_msgs/msg/PoseStamped": (
        {"header": HEADER, "pose": POSE},
        {**PLACED, "covariance": [np.nan] * 36},
        T,
    ),
    "geometry_msgs/msg/PoseArray": (
        {"header": HEADER, "poses": [POSE, POSE]},
        {"xyyaw": [1, 2, YAW] * 2, "weights": []},
        T,
    ),
    "nav2_msgs/msg/ParticleCloud": (
        {"header": HEADER, "particles": [{"pose": POSE, "weight": 0.5}]},
        {"xyyaw": [1, 2, YAW], "weights": [0.5]},
        T,
    ),
    "fiducial_msgs/msg/FiducialTransformArray": (
        {
            "header": HEADER,
            "image_seq": 1,
            "transforms": [
                {"fiducial_id": 7, "transform": {"translation": XYZ, "rotation": TURN}, **ERRORS}
            ],
        },
        {**PLACED, "child_frame_id": "tag_7", "kind": "fiducial"},
        T,
    ),
    "apriltag_ros/msg/AprilTagDetectionArray": (
        {
            "header": HEADER,
            "detections": [{"id": [7], "size": [0.1], "pose": {"header": HEADER, "pose": POSED}}],
        },
        {**PLACED, "child_frame_id": "tag_7", "covariance": COV36},
        T,
    ),
    "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray": (
        {
            "header": HEADER,
            "detections": [{"family": "36h11", "id": 7, "pose": {"header": HEADER, "pose": POSED}}],
        },
        {**PLACED, "child_frame_id": "tag_7", "covariance": COV36},
        T,
    ),
    "aruco_msgs/msg/MarkerArray": (
        {"header": HEADER, "markers": [MARKER]},
        {**PLACED, "child_frame_id": "tag_7", "covariance": COV36},
        T,
    ),
    "aruco_msgs/msg/Marker": (
        MARKER,
        {**PLACED, "child_frame_id": "tag_7", "covariance": COV36},
        T,
    ),
    "ros2_aruco_interfaces/msg/ArucoMarkers": (
        {"header": HEADER, "marker_ids": [7], "poses": [POSE]},
        {**PLACED, "child_frame_id": "tag_7", "kind": "fiducial"},
        T,
    ),
    "aruco_interfaces/msg/ArucoMarkers": (
        {"header": HEADER, "marker_ids": [7], "poses": [POSE]},
        {**PLACED, "child_frame_id": "tag_7", "kind": "fiducial"},
        T,
    ),
    "ar_track_alvar_msgs/msg/AlvarMarkers": (
        {
            "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
            "markers": [{"header": HEADER, "id": 7, "pose": {"header": HEADER, "pose": POSE}}],
        },
        {**PLACED, "child_frame_id": "tag_7", "kind": "fiducial"},
        T,
    ),
    "cartographer_ros_msgs/msg/LandmarkList": (
        {
            "header": HEADER,
            "landmark": [
                {
                    "id": "7",
                    "tracking_from_landmark_transform": POSE,
                    "translation_weight": 1.0,
                    "rotation_weight": 1.0,
                }
            ],
        },
        {**PLACED, "child_frame_id": "tag_7", "covariance": [np.nan] * 36},
        T,
    ),
    "sensor_msgs/msg/NavSatFix": (
        {
            "header": HEADER,
            "status": {"status": 0, "service": 1},
            "latitude": 0.0,
            "longitude": 0.0,
            "altitude": 3.0,
            "position_covariance": COV9,
            "position_covariance_type": 0,
        },
        {
            "position_xyz": [6378140, 0, 0],
            "frame_id": "earth",
            "child_frame_id": "f",
            "kind": "gnss",
        },
        T,
    ),
    "tf2_msgs/msg/TFMessage": ({"transforms": [TF]}, EDGE, T),
    "tf/msg/tfMessage": ({"transforms": [TF]}, EDGE, T),
    "std_msgs/msg/Float32": ({"data": 0.5}, {"value": 0.5}, None),
    "std_msgs/msg/Float64": ({"data": 0.5}, {"value": 0.5}, None),
    "geometry_msgs/msg/Vector3Stamped": (
        {"header": HEADER, "vector": XYZ},
        {"name": "x", "value": 1},
        T,
    ),
    "autoware_internal_debug_msgs/msg/Float32Stamped": (
        {"stamp": STAMP, "data": 0.5},
        {"value": 0.5},
        T,
    ),
    "tier4_debug_msgs/msg/Float32Stamped": ({"stamp": STAMP, "data": 0.5}, {"value": 0.5}, T),
    "nav_msgs/msg/OccupancyGrid": (
        {"header": HEADER, "info": GRID, "data": [0, 100]},
        {"cells": [0, 100], "width": 2, "origin_xyyaw": [1, 2, YAW]},
        T,
    ),
    "nav2_msgs/msg/Costmap": (
        {"header": HEADER, "metadata": COSTS, "data": [254, 255]},
        {"cells": [100, -1], "height": 1, "resolution_m": 0.5},
        T,
    ),
    "map_msgs/msg/OccupancyGridUpdate": (
        {"header": HEADER, "x": 3, "y": 4, "width": 2, "height": 1, "data": [-1, 100]},
        {"frame_id": "f", "x": 3, "y": 4, "width": 2, "height": 1, "cells": [-1, 100]},
        T,
    ),
    "nav2_msgs/msg/CostmapUpdate": (
        {"header": HEADER, "x": 3, "y": 4, "size_x": 1, "size_y": 2, "data": [253, -1]},
        {"x": 3, "y": 4, "width": 1, "height": 2, "cells": [99, -1]},
        T,
    ),
    "costmap_2d/msg/VoxelGrid": ({"header": HEADER, **VOXELS}, SEEN_FROM_ABOVE, T),
    "nav2_msgs/msg/VoxelGrid": ({"header": HEADER, **VOXELS}, SEEN_FROM_ABOVE, T),
    "nav_msgs/msg/Path": (
        {"header": HEADER, "poses": [{"header": HEADER, "pose": POSE}]},
        {"xyyaw": [1, 2, YAW], "frame_id": "f"},
        T,
    ),
    "geometry_msgs/msg/Twist": (TWIST, VELOCITY, None),
    "geometry_msgs/msg/TwistStamped": (
        {"header": HEADER, "twist": TWIST},
        {**VELOCITY, "frame_id": "f", "twist_covariance": [np.nan] * 36},
        T,
    ),
    "geometry_msgs/msg/TwistWithCovarianceStamped": (
        {"header": HEADER, "twist": {"twist": TWIST, "covariance": COV36}},
        {**VELOCITY, "frame_id": "f", "twist_covariance": COV36},
        T,
    ),
    "sensor_msgs/msg/JointState": (
        {
            "header": HEADER,
            "name": ["left", "right"],
            "position": [1.0, 2.0],
            "velocity": [3.0, 4.0],
            "effort": [],
        },
        {"name": "left", "position": 1, "velocity": 3, "effort": np.nan},
        T,
    ),
    "sensor_msgs/msg/MagneticField": (
        {"header": HEADER, "magnetic_field": XYZ, "magnetic_field_covariance": COV9},
        {"magnetic_field_xyz": [1, 2, 3], "magnetic_field_covariance": COV9, "frame_id": "f"},
        T,
    ),
    "ackermann_msgs/msg/AckermannDrive": (DRIVE, DRIVEN, None),
    "ackermann_msgs/msg/AckermannDriveStamped": ({"header": HEADER, "drive": DRIVE}, DRIVEN, T),
    "nav2_msgs/msg/BehaviorTreeLog": (
        {"timestamp": STAMP, "event_log": [SPIN]},
        {"name": "Spin", "status": "running", "source": "behavior_tree"},
        T,
    ),
    "move_base_msgs/msg/RecoveryStatus": (
        {"pose_stamped": {"header": HEADER, "pose": POSE}, "recovery_behavior_name": "rotate"},
        {"name": "rotate", "source": "recovery_status"},
        T,
    ),
    "diagnostic_msgs/msg/DiagnosticArray": (
        {
            "header": HEADER,
            "status": [{"level": b"\x02", "name": "n", "message": "hot", "values": []}],
        },
        {"level": 2, "name": "n", "message": "hot"},
        T,
    ),
    "diagnostic_msgs/msg/DiagnosticStatus": (
        {"level": b"\x02", "name": "n", "message": "hot", "values": []},
        {"level": 2, "name": "n", "message": "hot"},
        None,
    ),
    "sensor_msgs/msg/BatteryState": (
        {"header": HEADER, "power_supply_status": 1, "current": 2.0, "location": ""},
        {"level": 20, "name": "battery", "message": "charging"},
        T,
    ),
    "rcl_interfaces/msg/ParameterEvent": (
        {
            "stamp": STAMP,
            "node": "/amcl",
            "new_parameters": [],
            "changed_parameters": [
                {"name": "max_beams", "value": {"type": 2, "integer_value": 60}},
            ],
            "deleted_parameters": [],
        },
        {"level": 20, "name": "/amcl: max_beams", "message": "set to 60"},
        T,
    ),
    "dynamic_reconfigure/msg/Config": (
        {
            "bools": [{"name": "on", "value": True}],
            "ints": [],
            "strs": [],
            "doubles": [],
            "groups": [],
        },
        {"level": 20, "name": ": on", "message": "set to true"},
        None,
    ),
    "lifecycle_msgs/msg/TransitionEvent": (
        {
            "timestamp": 0,
            "transition": {"id": 3, "label": "activate"},
            "start_state": {"id": 2, "label": "inactive"},
            "goal_state": {"id": 3, "label": "active"},
        },
        {"level": 20, "message": "inactive -> active"},
        None,
    ),
    "rtabmap_msgs/msg/Info": (
        {
            "header": HEADER,
            "ref_id": 12,
            "loop_closure_id": 3,
            "proximity_detection_id": 0,
            "landmark_id": 0,
            "stats_keys": ["Loop/Highest_hypothesis_id/", "Loop/Highest_hypothesis_value/"],
            "stats_values": [3.0, 0.5],
        },
        {"kind": "loop_closure", "from_id": "12", "to_id": "3", "score": 0.5, "frame_id": "f"},
        T,
    ),
    "rtabmap_ros/msg/Info": (
        {
            "header": HEADER,
            "refId": 12,
            "loopClosureId": 0,
            "proximityDetectionId": 4,
            "statsKeys": [],
            "statsValues": [],
        },
        {"kind": "proximity", "from_id": "12", "to_id": "4", "score": np.nan},
        T,
    ),
    "visualization_msgs/msg/MarkerArray": (
        {
            "markers": [
                {**NODE, "id": 1, "pose": {"position": {"x": 0.0, "y": 0.0, "z": 0.0}}},
                {**NODE, "id": 9, "pose": {"position": {"x": 1.0, "y": 2.0, "z": 3.0}}},
                {
                    **NODE,
                    "id": 0,
                    "type": 5,
                    "pose": POSE,
                    "points": [XYZ, {"x": 0.0, "y": 0.0, "z": 0.0}],
                },
            ]
        },
        {"kind": "link", "from_id": "9", "to_id": "1", "from_xyz": [1, 2, 3], "number": 0},
        T,
    ),
    "rosgraph_msgs/msg/Clock": ({"clock": STAMP}, {"clock_ns": T}, None),
    "nav2_msgs/srv/SetInitialPose_Event": (
        {
            "info": {"event_type": 1, "stamp": STAMP},
            "request": [{"pose": {"header": HEADER, "pose": POSED}}],
            "response": [],
        },
        {**PLACED, "covariance": COV36},
        T,
    ),
    "action_msgs/msg/GoalStatusArray": (
        {"status_list": [GOAL]},
        {"name": "spin", "status": "aborted", "goal": "07" * 16, "source": "action"},
        None,
        {"topic": "/spin/_action/status", "after": NO_GOALS},
    ),
    "actionlib_msgs/msg/GoalStatusArray": (
        {"header": HEADER, "status_list": [{"goal_id": GOAL_ID, "status": 4, "text": ""}]},
        {"name": "move_base", "status": "aborted", "goal": "g", "source": "action"},
        T,
        {"topic": "/move_base/status", "after": {"header": HEADER, **NO_GOALS}},
    ),
    **{
        f"nav2_msgs/action/{action}_FeedbackMessage": behaviour(action)
        for action in ("Spin", "BackUp", "Wait", "DriveOnHeading", "AssistedTeleop")
    },
    **{
        f"nav2_msgs/action/{action}_FeedbackMessage": counted(
            "number_of_recoveries",
            {"name": "recovery 2", "source": "navigation_feedback"},
            **PROGRESS,
        )
        for action in ("NavigateToPose", "NavigateThroughPoses")
    },
    **{
        f"{package}/action/DockRobot_FeedbackMessage": counted(
            "num_retries", {"name": "docking retry 2"}
        )
        for package in ("nav2_msgs", "opennav_docking_msgs")
    },
    **{
        f"nav2_msgs/action/{action}_SendGoal_Event": sent(action)
        for action in (
            "Spin",
            "BackUp",
            "Wait",
            "DriveOnHeading",
            "AssistedTeleop",
            "NavigateToPose",
            "NavigateThroughPoses",
        )
    },
    **{
        f"nav2_msgs/srv/{service}_Event": cleared(service)
        for service in (
            "ClearEntireCostmap",
            "ClearCostmapAroundRobot",
            "ClearCostmapExceptRegion",
            "ClearCostmapAroundPose",
        )
    },
    "std_srvs/srv/Empty_Event": (
        event(1),
        {"name": "reinitialize_global_localization", "status": "running", "source": "service"},
        T,
        {"topic": "/reinitialize_global_localization/_service_event", "after": event(2)},
    ),
    "move_base_msgs/msg/MoveBaseActionGoal": (
        {"header": HEADER, "goal_id": GOAL_ID, "goal": TARGET},
        {"name": "move_base", "status": "pending", "goal": "g"},
        T,
    ),
    "move_base_msgs/msg/MoveBaseActionFeedback": (
        {**ENDED, "feedback": {"base_position": {"header": HEADER, "pose": POSE}}},
        {"name": "move_base", "status": "active", "goal": "g"},
        T,
        {"after": {"header": HEADER, "status": {"goal_id": {"stamp": STAMP, "id": "f"}}}},
    ),
    "move_base_msgs/msg/MoveBaseActionResult": (
        {**ENDED, "result": {}},
        {"name": "move_base", "status": "succeeded", "goal": "g"},
        T,
    ),
    "mbf_msgs/msg/MoveBaseActionGoal": (
        {"header": HEADER, "goal_id": GOAL_ID, "goal": TARGET},
        {"name": "move_base", "status": "pending", "goal": "g"},
        T,
    ),
    "mbf_msgs/msg/MoveBaseActionResult": (
        {**ENDED, "result": {"outcome": 15, "message": "blocked", **MBF_ENDED}},
        {"name": "move_base", "status": "aborted", "goal": "g"},
        T,
    ),
    "mbf_msgs/msg/RecoveryActionGoal": (
        {
            "header": HEADER,
            "goal_id": GOAL_ID,
            "goal": {"behavior": "rotate", "concurrency_slot": 0},
        },
        {"name": "rotate", "status": "pending", "goal": "g", "source": "action"},
        T,
    ),
    "mbf_msgs/msg/RecoveryActionResult": (
        {**ENDED, "result": {"outcome": 151, "message": "", "used_plugin": "rotate"}},
        {"name": "rotate", "status": "canceled", "goal": "g"},
        T,
    ),
    "mbf_msgs/msg/ExePathActionResult": (
        {**ENDED, "result": {"outcome": 106, "message": "stuck", **MBF_ENDED}},
        {"level": 106, "name": "exe_path", "message": "outcome 106: stuck"},
        T,
    ),
    "nav2_msgs/msg/CollisionMonitorState": (
        {"action_type": 1, "polygon_name": "front"},
        {"level": 1, "message": "collision monitor: stop by polygon front"},
        None,
        {"after": {"action_type": 0, "polygon_name": ""}},
    ),
    "nav2_msgs/msg/CollisionDetectorState": (
        {"polygons": ["front", "rear"], "detections": [False, True]},
        {"level": 1, "message": "collision detector: points in rear"},
        None,
        {"after": {"polygons": ["front", "rear"], "detections": [False, False]}},
    ),
    "nav2_msgs/msg/SpeedLimit": (
        {"header": HEADER, "percentage": True, "speed_limit": 50.0},
        {"name": "speed_limit", "message": "speed limit: 50 %"},
        T,
        {"after": {"header": HEADER, "percentage": True, "speed_limit": 0.0}},
    ),
    "rcl_interfaces/msg/Log": ({"stamp": STAMP, **LOG}, {"level": 4, "message": "text"}, T),
    "rosgraph_msgs/msg/Log": ({"header": HEADER, **LOG}, {"level": 4, "message": "text"}, T),
    "foxglove_msgs/msg/PoseInFrame": (
        {**PLAIN_STAMP, "pose": POSE},
        {**PLACED, "covariance": [np.nan] * 36},
        T,
    ),
    "foxglove_msgs/msg/PosesInFrame": (
        {**PLAIN_STAMP, "poses": [POSE, POSE]},
        {"xyyaw": [1, 2, YAW] * 2, "weights": [], "frame_id": "f"},
        T,
    ),
    "foxglove_msgs/msg/FrameTransform": (FOX_EDGE, EDGE, T),
    "foxglove_msgs/msg/FrameTransforms": ({"transforms": [FOX_EDGE]}, EDGE, T),
    "foxglove_msgs/msg/Odometry": (
        {
            **PLAIN_STAMP,
            "body_frame_id": "/b",
            "pose": POSE,
            "linear_velocity": XYZ,
            "angular_velocity": TWIST["angular"],
            "pose_covariance": COV36,
            "velocity_covariance": COV36,
        },
        {**PLACED, **VELOCITY, "child_frame_id": "b", "twist_covariance": COV36},
        T,
    ),
    "foxglove_msgs/msg/LaserScan": (
        {
            **PLAIN_STAMP,
            "pose": UNTURNED,
            "start_angle": -1.0,
            "end_angle": 1.0,
            "ranges": [1.0, float("inf"), 4.0],
        },
        {"ranges_m": [1, np.inf, 4], "angle_increment_rad": 1, "range_max_m": 4, "frame_id": "f"},
        T,
    ),
    "foxglove_msgs/msg/PointCloud": (
        {
            **PLAIN_STAMP,
            "pose": UNTURNED,
            "point_stride": 12,
            "fields": PACKED,
            "data": XYZ_BYTES,
        },
        {"points_xyz": [1, 2, 3], "frame_id": "f"},
        T,
    ),
    "foxglove_msgs/msg/Grid": (
        {
            **PLAIN_STAMP,
            "pose": POSE,
            "column_count": 2,
            "cell_size": {"x": 0.5, "y": 0.5},
            "row_stride": 5,
            "cell_stride": 2,
            "fields": [{"name": "occupancy", "offset": 1, "type": 1}],
            "data": [7, 0, 7, 100, 7, 7, 255, 7, 65, 7],
        },
        {"cells": [0, 100, -1, 65], "width": 2, "height": 2, "origin_xyyaw": [1, 2, YAW]},
        T,
    ),
    "foxglove_msgs/msg/LocationFix": (FOX_FIX, FOX_FIX_ROW, T),
    "foxglove_msgs/msg/LocationFixes": ({"fixes": [FOX_FIX]}, FOX_FIX_ROW, T),
    "foxglove_msgs/msg/Log": (
        {"timestamp": STAMP, "level": 4, "name": "n", "message": "text"},
        {"level": 4, "name": "n", "message": "text"},
        T,
    ),
}


@pytest.mark.parametrize("name", ESTIMATOR_LINES)
def test_estimator(name):
    tolerance_m, tolerance_rad = ESTIMATOR_LINES[name]
    bundle = synthetic_bundle(seconds=LAPS_S[name], with_tags=True) if name in LAPS_S else None
    estimator = ESTIMATORS.load(name)()
    check_estimator(estimator, bundle=bundle, tolerance_m=tolerance_m, tolerance_rad=tolerance_rad)


@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_estimators_covariance_follows_its_noise(name):
    check_noise(ESTIMATORS.load(name)(), worlds=WORLDS.get(name, noisy_bundle))


@pytest.mark.parametrize("name", PERTURBATION_LINES)
def test_perturbation(name):
    made = PERTURBED.get(name, partial(synthetic_bundle, seconds=8.0, with_imu=True))
    check_perturbation(PERTURBATIONS.load(name)(), bundle=made(), levels=PERTURBED_BY.get(name))


@pytest.mark.parametrize("name", DECODER_LINES)
def test_decoder(name):
    message, row, stamp, *more = DECODER_LINES[name]
    stamped = {} if stamp is None else {"t_sensor_ns": stamp}
    check_decoder(DECODERS.load(name), message, row, **stamped, **(more[0] if more else {}))


def test_every_registered_name_has_its_line():
    assert sorted(ESTIMATORS) == sorted(ESTIMATOR_LINES)
    assert sorted(PERTURBATIONS) == sorted(PERTURBATION_LINES)
    assert sorted(DECODERS) == sorted(DECODER_LINES)


def test_names_are_those_they_are_registered_under():
    for registry in (ESTIMATORS, PERTURBATIONS):
        for name in registry:
            assert registry.load(name).name == name


@pytest.mark.parametrize(
    ("store", "encoding"), [(Stores.ROS2_HUMBLE, "cdr"), (Stores.ROS1_NOETIC, "ros1")]
)
def test_payloads_of_wrong_length_and_of_unknown_type_are_counted(store, encoding):
    types = get_typestore(store)
    vector = types.types["geometry_msgs/msg/Vector3"]
    name = "geometry_msgs/msg/Twist"
    twist = types.types[name](
        linear=vector(x=1.0, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=2.0)
    )
    serialise = types.serialize_cdr if encoding == "cdr" else types.serialize_ros1

    check_payload(name, bytes(serialise(twist, name)), encoding=encoding)
