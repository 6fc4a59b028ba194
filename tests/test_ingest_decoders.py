"""Every decoder gives the numbers that rosbags gives, and mends or counts what cannot be."""

import numpy as np
import pytest

from slamreplay.bundle.schema import TABLES
from slamreplay.geometry.se3 import yaw_from_quaternion
from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest import DECODERS
from slamreplay.ingest.decoders.decoder import Messages
from slamreplay.ingest.decoders.grid import COST_SCALE
from slamreplay.messages.definitions import LATER_DEFINITIONS
from slamreplay.messages.interfaces import as_message

T_LOG = np.array([10, 20, 30], dtype=np.int64)


def decode(kind, *items):
    messages = Messages(items, T_LOG[: len(items)])
    return DECODERS.load(kind).decode(messages)


def remarks(decoded):
    return {(r.kind, r.reason): r.count for r in decoded.remarks if r.count}


def turned(message, path, yaw):
    target = message
    for name in path.split("."):
        target = getattr(target, name)
    target.z, target.w = float(np.sin(yaw / 2)), float(np.cos(yaw / 2))
    return message


@pytest.fixture
def random_message(logs):
    """A message of any type with random numbers in every float field."""
    rng = np.random.default_rng(5)

    def fill(node):
        for name in node.__dataclass_fields__:
            value = getattr(node, name)
            if hasattr(value, "__dataclass_fields__") and not name.startswith("__"):
                fill(value)
            elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
                setattr(node, name, rng.normal(size=value.shape).astype(value.dtype))
            elif isinstance(value, float) or (value == 0 and name in "xyzw"):
                setattr(node, name, float(rng.normal()))
        return node

    return lambda kind, **values: fill(logs.make(kind, **values))


def test_every_decoder_fills_the_columns_of_its_table(logs):
    times = {"t_ns", "t_sensor_ns", "t_log_ns", "topic"}
    for kind in DECODERS:
        ros = 2 if as_message(kind) in logs.stores[2].fielddefs else 1
        decoded = decode(kind, logs.make(as_message(kind), ros))
        schema = TABLES[DECODERS.load(kind).table]
        assert set(decoded.columns) == {c.name for c in schema.columns} - times, kind
        assert len(decoded.rows) == len(decoded.t_sensor_ns), kind


def test_odometry(random_message):
    items = [random_message("nav_msgs/msg/Odometry") for _ in range(3)]
    items[1].header.stamp.sec, items[1].header.stamp.nanosec = 2_000_000_000, 7
    items[1].header.frame_id, items[1].child_frame_id = "/odom", "base_link"

    decoded = decode("nav_msgs/msg/Odometry", *items)

    row = {k: v[1] for k, v in decoded.columns.items()}
    pose, twist = items[1].pose, items[1].twist
    p, q, w = pose.pose.position, pose.pose.orientation, twist.twist.angular
    assert row["position_xyz"].tolist() == [p.x, p.y, p.z]
    unit = np.array([q.x, q.y, q.z, q.w]) / np.linalg.norm([q.x, q.y, q.z, q.w])
    np.testing.assert_allclose(row["orientation_xyzw"], unit, rtol=1e-14)
    np.testing.assert_array_equal(row["pose_covariance"], pose.covariance)
    np.testing.assert_array_equal(row["twist_covariance"], twist.covariance)
    assert row["angular_velocity_xyz"].tolist() == [w.x, w.y, w.z]
    assert (row["frame_id"], row["child_frame_id"]) == ("odom", "base_link")
    assert decoded.t_sensor_ns.tolist() == [NO_STAMP, 2_000_000_000_000_000_007, NO_STAMP]
    assert remarks(decoded) == {
        ("repaired", "quaternion normalised"): 3,
        ("repaired", "leading slash taken off frame names"): 1,
    }


def test_zero_quaternions_and_wild_positions_lose_their_rows(logs):
    kind = "geometry_msgs/msg/PoseStamped"
    zero = logs.make(kind)
    wild = logs.make(kind, pose__orientation__w=1.0, pose__position__y=float("nan"))
    good = logs.make(kind, pose__orientation__w=1.0, pose__position__y=2.0)

    decoded = decode(kind, zero, wild, good)

    assert decoded.rows.tolist() == [2]
    assert remarks(decoded) == {
        ("lost", "quaternion is zero or not finite"): 1,
        ("lost", "position is not finite"): 1,
    }


def test_pose_with_covariance_keeps_a_zero_covariance(logs):
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    decoded = decode(kind, logs.make(kind, pose__pose__orientation__w=1.0))

    assert decoded.columns["covariance"].tolist() == [[0.0] * 36]


def test_imu_quantities_that_are_not_measured_are_nan(random_message):
    kind = "sensor_msgs/msg/Imu"
    message = random_message(kind)
    message.orientation_covariance[0] = -1.0
    message.linear_acceleration_covariance[0] = 4.0

    decoded = decode(kind, message)

    assert np.isnan(decoded.columns["orientation_xyzw"]).all()
    assert np.isnan(decoded.columns["orientation_covariance"]).all()
    rate = message.angular_velocity
    assert decoded.columns["angular_velocity_xyz"][0].tolist() == [rate.x, rate.y, rate.z]
    assert decoded.columns["linear_acceleration_covariance"][0, 0] == 4.0


@pytest.mark.parametrize(("angle_max", "odd"), [(0.75, 0), (1.0, 0), (0.0, 0), (2.5, 1), (-2, 1)])
def test_a_last_beam_that_is_elsewhere_is_remarked_upon(logs, angle_max, odd):
    kind = "sensor_msgs/msg/LaserScan"
    scan = logs.make(
        kind, angle_min=-1.0, angle_max=angle_max, angle_increment=0.25, range_max=9.0,
        ranges=np.ones(8, np.float32),
    )  # fmt: skip

    decoded = decode(kind, scan)

    assert decoded.columns["angle_increment_rad"].tolist() == [0.25]  # beams are where these say
    assert sum(remarks(decoded).values()) == odd


def test_laser_ranges_stay_as_recorded(logs):
    kind = "sensor_msgs/msg/LaserScan"
    ranges = np.float32([0.0, np.inf, -np.inf, np.nan, 3.25])
    scan = logs.make(kind, ranges=ranges, angle_min=-1.5, angle_increment=0.25, range_max=9.0)
    flat = logs.make(kind, ranges=ranges, range_max=9.0)

    decoded = decode(kind, scan, flat)

    np.testing.assert_array_equal(decoded.columns["ranges_m"][0], ranges)
    assert decoded.columns["angle_increment_rad"].tolist() == [0.25]
    assert remarks(decoded) == {("lost", "angle increment is zero"): 1}


def test_point_cloud_of_mixed_layout(logs):
    field = "sensor_msgs/msg/PointField"
    layout = np.dtype([("i", "<u2"), ("z", "<f8"), ("x", "<f4"), ("y", "<f4")])
    cells = np.array([(1, 3.0, 1.0, 2.0), (1, np.nan, 0.0, 0.0)], dtype=layout)
    cloud = logs.make(
        "sensor_msgs/msg/PointCloud2",
        height=1, width=2, point_step=layout.itemsize, row_step=2 * layout.itemsize,
        data=np.frombuffer(cells.tobytes(), np.uint8),
        fields=[
            logs.make(field, name=n, offset=layout.fields[n][1], datatype=8 if n == "z" else 7)
            for n in "xyz"
        ],
    )  # fmt: skip
    short = logs.make("sensor_msgs/msg/PointCloud2", height=1, width=2, fields=cloud.fields)

    decoded = decode("sensor_msgs/msg/PointCloud2", cloud, short)

    assert decoded.columns["points_xyz"][0].tolist() == [1.0, 2.0, 3.0]
    assert decoded.rows.tolist() == [0]


def test_particles_with_and_without_weights(logs):
    pose = turned(logs.make("geometry_msgs/msg/Pose", position__x=1.0), "orientation", 0.3)
    zero = logs.make("geometry_msgs/msg/Pose")
    particle = logs.make("nav2_msgs/msg/Particle", pose=pose, weight=0.25)
    cloud = logs.make("nav2_msgs/msg/ParticleCloud", particles=[particle])
    array = logs.make("geometry_msgs/msg/PoseArray", poses=[zero, pose, pose])

    weighted = decode("nav2_msgs/msg/ParticleCloud", cloud)
    plain = decode("geometry_msgs/msg/PoseArray", array)

    np.testing.assert_allclose(weighted.columns["xyyaw"][0], [1.0, 0.0, 0.3])
    assert weighted.columns["weights"][0].tolist() == [0.25]
    np.testing.assert_allclose(plain.columns["xyyaw"][0], [1.0, 0.0, 0.3] * 2)
    assert plain.columns["weights"][0].tolist() == []
    assert remarks(plain) == {("lost", "particles: quaternion is zero or not finite"): 1}


@pytest.mark.parametrize("kind", ["tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"])
def test_transforms(logs, kind):
    def edge(parent, child):
        return turned(
            logs.make(
                "geometry_msgs/msg/TransformStamped",
                header__frame_id=parent, header__stamp__sec=3, child_frame_id=child,
                transform__translation__x=0.5,
            ),
            "transform.rotation", 1.0,
        )  # fmt: skip

    decoded = decode(
        kind, logs.make(kind, transforms=[edge("/odom", "base"), edge("", "a"), edge("a", "a")])
    )

    assert decoded.columns["parent_frame"].tolist() == ["odom"]
    assert decoded.t_sensor_ns.tolist() == [3_000_000_000]
    assert decoded.columns["translation_xyz"][0, 0] == 0.5
    np.testing.assert_allclose(yaw_from_quaternion(decoded.columns["rotation_xyzw"]), [1.0])
    assert remarks(decoded) == {
        ("lost", "a frame without a name, or its own parent"): 2,
        ("repaired", "leading slash taken off frame names"): 1,
    }


def test_occupancy_grid_and_costmap(logs):
    grid = logs.make(
        "nav_msgs/msg/OccupancyGrid",
        info__width=2, info__height=1, info__resolution=0.5, info__origin__position__x=-3.0,
        info__origin__orientation__w=1.0, data=np.int8([-1, 100]),
    )  # fmt: skip
    short = logs.make("nav_msgs/msg/OccupancyGrid", info__width=3, info__height=1)
    costmap = logs.make(
        "nav2_msgs/msg/Costmap",
        metadata__size_x=6, metadata__size_y=1, metadata__resolution=0.5,
        data=np.uint8([0, 1, 252, 253, 254, 255]),
    )  # fmt: skip

    one = decode("nav_msgs/msg/OccupancyGrid", grid, short)
    two = decode("nav2_msgs/msg/Costmap", costmap)

    assert one.columns["cells"][0].tolist() == [-1, 100]
    assert one.columns["origin_xyyaw"].tolist() == [[-3.0, 0.0, 0.0]]
    assert ("lost", "size, resolution and number of cells do not fit") in remarks(one)
    assert two.columns["cells"][0].tolist() == [0, 1, 98, 99, 100, -1]


def test_cost_scale_rises_and_ends_as_nav2_says():
    assert (np.diff(COST_SCALE[:255].astype(int)) >= 0).all()
    assert COST_SCALE.shape == (256,)


def test_path_and_twists(logs):
    pose = logs.make("geometry_msgs/msg/PoseStamped", pose__position__x=4.0)
    path = decode("nav_msgs/msg/Path", logs.make("nav_msgs/msg/Path", poses=[pose, pose]))
    twist = decode("geometry_msgs/msg/Twist", logs.make("geometry_msgs/msg/Twist", linear__x=0.5))
    kind = "geometry_msgs/msg/TwistStamped"
    stamped = decode(kind, logs.make(kind, twist__angular__z=0.2, header__stamp__sec=1))
    wild = decode("geometry_msgs/msg/Twist",
                  logs.make("geometry_msgs/msg/Twist", linear__x=float("inf")))  # fmt: skip

    assert path.columns["xyyaw"][0].tolist() == [4.0, 0.0, 0.0] * 2
    assert twist.columns["linear_velocity_xyz"].tolist() == [[0.5, 0.0, 0.0]]
    assert stamped.columns["angular_velocity_xyz"].tolist() == [[0.0, 0.0, 0.2]]
    assert stamped.t_sensor_ns.tolist() == [1_000_000_000]
    assert remarks(wild) == {("lost", "velocity is not finite"): 1}


def test_behavior_tree_log_takes_the_logs_stamp_for_its_events(logs):
    change = "nav2_msgs/msg/BehaviorTreeStatusChange"
    events = [
        logs.make(change, node_name=name, current_status="RUNNING", timestamp__sec=9_999)
        for name in ("ComputePathToPose", "ClearLocalCostmap-Context", "Spin")
    ]
    log = logs.make("nav2_msgs/msg/BehaviorTreeLog", timestamp__sec=5, event_log=events)

    decoded = decode("nav2_msgs/msg/BehaviorTreeLog", log)

    assert decoded.columns["name"].tolist() == ["ClearLocalCostmap-Context", "Spin"]
    assert decoded.columns["status"].tolist() == ["running", "running"]
    assert decoded.t_sensor_ns.tolist() == [5_000_000_000] * 2


def test_behavior_tree_log_with_uid_is_read_from_its_own_definition(logs):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name in ("nav2_msgs/msg/BehaviorTreeStatusChange", "nav2_msgs/msg/BehaviorTreeLog"):
        from slamreplay.messages.definitions import DEFINITIONS

        text = LATER_DEFINITIONS.get(name, DEFINITIONS[name])
        store.register(get_types_from_msg(text, name))
    logs.stores[2] = store
    change = logs.make("nav2_msgs/msg/BehaviorTreeStatusChange", node_name="BackUp", uid=7)
    log = logs.make("nav2_msgs/msg/BehaviorTreeLog", event_log=[change])
    path = logs.write("bt.mcap", [("/bt", "nav2_msgs/msg/BehaviorTreeLog", log, 1)])

    from slamreplay.ingest.readers.open_log import open_log
    from slamreplay.ingest.reading import read_rows

    with open_log([path]) as (readers, _):
        (topic,), losses = read_rows(readers, lambda _topic: None, None)

    assert topic.columns["name"].tolist() == ["BackUp"]
    assert losses == []


def test_recovery_status(logs):
    kind = "move_base_msgs/msg/RecoveryStatus"
    decoded = decode(kind, logs.make(kind, recovery_behavior_name="rotate_recovery"))

    assert decoded.columns["name"].tolist() == ["rotate_recovery"]
    assert decoded.columns["source"].tolist() == ["recovery_status"]


def test_diagnostics_and_log_lines(logs):
    states = [
        logs.make("diagnostic_msgs/msg/DiagnosticStatus", level=2, name="laser", message="dirty"),
        logs.make("diagnostic_msgs/msg/DiagnosticStatus", name="base"),
    ]
    array = logs.make("diagnostic_msgs/msg/DiagnosticArray", status=states, header__stamp__sec=1)
    line = logs.make("rcl_interfaces/msg/Log", level=40, name="amcl", msg="lost", stamp__sec=2)
    old = logs.make("rosgraph_msgs/msg/Log", 1, level=8, name="/amcl", msg="lost",
                    header__stamp__sec=3)  # fmt: skip

    one = decode("diagnostic_msgs/msg/DiagnosticArray", array)
    two = decode("rcl_interfaces/msg/Log", line)
    three = decode("rosgraph_msgs/msg/Log", old)

    assert one.columns["level"].tolist() == [2, 0]
    assert one.columns["message"].tolist() == ["dirty", ""]
    assert one.t_sensor_ns.tolist() == [1_000_000_000] * 2
    assert two.columns["message"].tolist() == ["lost"]
    assert (two.t_sensor_ns.tolist(), three.t_sensor_ns.tolist()) == ([2 * 10**9], [3 * 10**9])
