"""Every registered estimator, perturbation and decoder keeps its contract: one line each."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from slamreplay.estimators import ESTIMATORS
from slamreplay.ingest import DECODERS
from slamreplay.perturb import PERTURBATIONS
from slamreplay.testing import check_decoder, check_estimator, check_perturbation
from slamreplay.testing.decoders import check_payload

#: Name, and by how much sampling noise lets its poses miss a moved map frame: m, rad.
ESTIMATOR_LINES = {
    "amcl": (0.25, 0.15),
    "dead_reckoning": (1e-6, 1e-6),
}

PERTURBATION_LINES = (
    "initial_pose",
    "odometry_scale",
    "scan_delay",
    "scan_drop",
    "tf_delay",
)

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
VELOCITY = {"linear_velocity_xyz": [1, 2, 3], "angular_velocity_xyz": [4, 5, 6]}

#: Message type: the fields of one message, what its first row holds, and its stamp.
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
    "geometry_msgs/msg/TwistStamped": ({"header": HEADER, "twist": TWIST}, VELOCITY, T),
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
    "rcl_interfaces/msg/Log": ({"stamp": STAMP, **LOG}, {"level": 4, "message": "text"}, T),
    "rosgraph_msgs/msg/Log": ({"header": HEADER, **LOG}, {"level": 4, "message": "text"}, T),
}


@pytest.mark.parametrize("name", ESTIMATOR_LINES)
def test_estimator(name):
    tolerance_m, tolerance_rad = ESTIMATOR_LINES[name]
    check_estimator(ESTIMATORS.load(name)(), tolerance_m=tolerance_m, tolerance_rad=tolerance_rad)


@pytest.mark.parametrize("name", PERTURBATION_LINES)
def test_perturbation(name):
    check_perturbation(PERTURBATIONS.load(name)())


@pytest.mark.parametrize("name", DECODER_LINES)
def test_decoder(name):
    message, row, stamp = DECODER_LINES[name]
    stamped = {} if stamp is None else {"t_sensor_ns": stamp}
    check_decoder(DECODERS.load(name), message, row, **stamped)


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
