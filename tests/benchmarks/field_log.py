"""A warehouse robot's log for the reading benchmarks: what it holds is what such logs hold.

Odometry 50 Hz, IMU 200 Hz, scans of 1081 beams at 15 Hz, tf 50 Hz and 15 Hz, a local costmap 5 Hz,
a behaviour tree 1 Hz, wheels 50 Hz, and where asked a camera. Numbers are
noise that compresses about as well as real ones do.
"""

from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slamreplay.messages.definitions import DEFINITIONS

SECOND = 10**9
START = 1_700_000_000 * SECOND
ODOM, IMU, SCAN = "nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu", "sensor_msgs/msg/LaserScan"
TF, GRID = "tf2_msgs/msg/TFMessage", "nav_msgs/msg/OccupancyGrid"
TREE, IMAGE = "nav2_msgs/msg/BehaviorTreeLog", "sensor_msgs/msg/CompressedImage"
JOINTS = "sensor_msgs/msg/JointState"


def store(ros):
    found = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        if name not in found.fielddefs:
            found.register(get_types_from_msg(text, name))
    return found


_PACKAGES = {"builtin_interfaces", "std_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs",
             "tf2_msgs", "nav2_msgs"}  # fmt: skip


class _Makers:
    def __init__(self, types, ros):
        self.t = {n.rpartition("/")[2]: c for n, c in types.types.items()
                  if n.partition("/")[0] in _PACKAGES}  # fmt: skip
        self.t["Time"] = types.types["builtin_interfaces/msg/Time"]  # std_msgs has one too
        self.seq = {"seq": 0} if ros == 1 else {}
        self.rng = np.random.default_rng(1)
        self.walls = 4.0 + np.cumsum(self.rng.normal(0, 0.01, 1081))

    def stamp(self, t):
        return self.t["Time"](sec=t // SECOND, nanosec=t % SECOND)

    def header(self, t, frame):
        return self.t["Header"](**self.seq, stamp=self.stamp(t), frame_id=frame)

    def vector(self, *xyz):
        return self.t["Vector3"](*(float(v) for v in xyz))

    def quaternion(self, yaw):
        return self.t["Quaternion"](0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))

    def pose(self, x, y, yaw):
        return self.t["Pose"](self.t["Point"](float(x), float(y), 0.0), self.quaternion(yaw))

    def odometry(self, t):
        s = (t - START) / SECOND
        cov = np.zeros(36)
        cov[[0, 7, 35]] = 1e-3 * s
        twist = self.t["Twist"](
            self.vector(0.5 + self.rng.normal(0, 0.01), 0, 0), self.vector(0, 0, 0.1)
        )
        return self.t["Odometry"](
            self.header(t, "odom"), "base_link",
            self.t["PoseWithCovariance"](self.pose(0.5 * s, np.sin(s), 0.1 * s), cov),
            self.t["TwistWithCovariance"](twist, np.full(36, 1e-4)),
        )  # fmt: skip

    def imu(self, t):
        rate, accel = self.rng.normal(0, 0.01, 3), self.rng.normal(0, 0.1, 3)
        return self.t["Imu"](
            self.header(t, "imu_link"), self.quaternion(0.0), np.full(9, -1.0),
            self.vector(*rate), np.full(9, 1e-4), self.vector(*accel), np.full(9, 1e-2),
        )  # fmt: skip

    def scan(self, t):
        ranges = (self.walls + self.rng.normal(0, 0.01, 1081)).astype(np.float32)
        ranges[self.rng.integers(0, 1081, 30)] = np.inf
        step = np.float32(np.deg2rad(0.25))
        return self.t["LaserScan"](
            self.header(t, "laser"), -540 * float(step), 540 * float(step), float(step), 0.0,
            1 / 15, 0.05, 30.0, ranges, np.zeros(0, dtype=np.float32),
        )  # fmt: skip

    def tf(self, t, parent, child):
        s = (t - START) / SECOND
        transform = self.t["Transform"](
            self.vector(0.5 * s, np.sin(s), 0), self.quaternion(0.1 * s)
        )
        return self.t["TFMessage"](
            [self.t["TransformStamped"](self.header(t, parent), child, transform)]
        )

    def costmap(self, t):
        info = self.t["MapMetaData"](self.stamp(t), 0.05, 60, 60, self.pose(0, 0, 0))
        cells = self.rng.choice(np.array([0, 0, 0, 0, 50, 99, 100], dtype=np.int8), 3600)
        return self.t["OccupancyGrid"](self.header(t, "odom"), info, cells)

    def tree(self, t):
        names = ["NavigateRecovery", "FollowPath", "Spin"]
        events = [
            self.t["BehaviorTreeStatusChange"](self.stamp(t), n, "IDLE", "RUNNING") for n in names
        ]
        return self.t["BehaviorTreeLog"](self.stamp(t), events)

    def joints(self, t):
        values = np.array([0.1, 0.2])
        return self.t["JointState"](self.header(t, "base_link"), ["left", "right"], values, values,
                                    np.zeros(0))  # fmt: skip

    def image(self, t):
        pixels = self.rng.integers(0, 256, 60_000, dtype=np.uint8)
        return self.t["CompressedImage"](self.header(t, "camera"), "jpeg", pixels)


def messages(ros, seconds, *, camera):
    """(topic, type, log time, payload) in the order of time."""
    types = store(ros)
    make = _Makers(types, ros)
    streams = [
        ("/odom", ODOM, 50, make.odometry),
        ("/imu", IMU, 200, make.imu),
        ("/scan", SCAN, 15, make.scan),
        ("/tf", TF, 50, lambda t: make.tf(t, "odom", "base_link")),
        ("/tf", TF, 15, lambda t: make.tf(t, "map", "odom")),
        ("/local_costmap/costmap", GRID, 5, make.costmap),
        ("/joint_states", JOINTS, 50, make.joints),
    ]
    streams += [("/behavior_tree_log", TREE, 1, make.tree)] if ros == 2 else []
    streams += [("/camera/compressed", IMAGE, 10, make.image)] if camera else []
    due = []
    for k, (_, _, hz, _) in enumerate(streams):
        times = START + np.arange(seconds * hz) * (SECOND // hz)
        due.append(np.column_stack([times, np.full(len(times), k)]))
    order = np.concatenate(due)
    order = order[np.lexsort((order[:, 1], order[:, 0]))]
    serialise = types.serialize_ros1 if ros == 1 else types.serialize_cdr
    for t, k in order.tolist():
        topic, kind, _, build = streams[k]
        yield topic, kind, t + 2_000_000, bytes(serialise(build(t), kind))


def write(path: Path, seconds, *, compression="none", camera=False) -> Path:
    """A .mcap, .bag or .db3 of that kind; kept where it is already there."""
    if path.exists():
        return path
    ros = 1 if path.suffix == ".bag" else 2
    log = messages(ros, seconds, camera=camera)
    partial = path.with_suffix(f".partial{path.suffix}")
    {".mcap": _mcap, ".bag": _bag, ".db3": _db3}[path.suffix](partial, log, ros, compression)
    partial.rename(path)
    return path


def _mcap(path, log, ros, compression):
    from mcap.writer import CompressionType, Writer

    types = store(ros)
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType[compression.upper()])
        writer.start("ros2", "benchmark")
        channels = {}
        for topic, kind, t, payload in log:
            if topic not in channels:
                text, _ = types.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], t, payload, t)
        writer.finish()


def _bag(path, log, ros, compression):
    from rosbags.rosbag1 import Writer

    writer = Writer(path)
    if compression != "none":
        writer.set_compression(
            {"lz4": Writer.CompressionFormat.LZ4, "bz2": Writer.CompressionFormat.BZ2}[compression]
        )
    _rosbags(writer, log, store(ros))


def _db3(path, log, ros, compression):
    from rosbags.rosbag2 import StoragePlugin, Writer

    folder = path.with_suffix(".folder")
    _rosbags(Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3), log, store(ros))
    (file,) = folder.glob("*.db3")
    file.rename(path)
    (folder / "metadata.yaml").unlink()
    folder.rmdir()


def _rosbags(writer, log, types):
    with writer:
        connections = {}
        for topic, kind, t, payload in log:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(connections[topic], t, payload)
