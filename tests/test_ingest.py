"""A log becomes a bundle: roles, frames, clock, map, losses; bad input gives one line."""

import contextlib
import json

import numpy as np
import pytest
import yaml

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.format_page import format_page
from slamreplay.consistency.audits.inspection import inspect
from slamreplay.errors import LogError, MapError, OutputError, SlamreplayError, UsageError
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
ODOM, SCAN, TF = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
GRID, IMU = "nav_msgs/msg/OccupancyGrid", "sensor_msgs/msg/Imu"
STAMPED = "geometry_msgs/msg/PoseStamped"


class Robot:
    """Messages of a small robot: odom, scan, tf, amcl_pose at 10 Hz for a few seconds."""

    def __init__(self, logs, ns="", prefix="", steps=30, epoch=EPOCH, ros=2):
        self.logs, self.ns, self.prefix = logs, ns, prefix
        self.steps, self.epoch, self.ros = steps, epoch, ros

    def stamped(self, kind, step, **values):
        t_ns = self.epoch + step * SECOND // 10
        stamp = {"header__stamp__sec": t_ns // SECOND, "header__stamp__nanosec": t_ns % SECOND}
        return self.logs.make(kind, self.ros, **stamp, **values)

    def odometry(self, step, frame="odom"):
        return self.stamped(
            ODOM, step, header__frame_id=self.prefix + frame,
            child_frame_id=self.prefix + "base_link", pose__pose__position__x=0.1 * step,
            pose__pose__orientation__w=1.0,
        )  # fmt: skip

    def scan(self, step, beams=8):
        return self.stamped(
            SCAN, step, header__frame_id=self.prefix + "laser", angle_min=-1.0,
            angle_increment=0.25, range_min=0.1, range_max=9.0,
            ranges=np.full(beams, 2.0, np.float32),
        )  # fmt: skip

    def edge(self, step, parent, child, x=0.0):
        return self.stamped(
            "geometry_msgs/msg/TransformStamped", step, header__frame_id=self.prefix + parent,
            child_frame_id=self.prefix + child, transform__translation__x=x,
            transform__rotation__w=1.0,
        )  # fmt: skip

    def tf(self, *edges):
        return self.logs.make(TF, self.ros, transforms=list(edges))

    def pose(self, step, frame="map", x=0.0, kind=POSE):
        path = "pose__pose" if kind == POSE else "pose"
        return self.stamped(
            kind, step, header__frame_id=frame,
            **{f"{path}__position__x": x, f"{path}__orientation__w": 1.0},
        )  # fmt: skip

    def messages(self, amcl=True):
        out = [(f"{self.ns}/tf_static", TF, self.tf(self.edge(0, "base_link", "laser", 0.2)), 0)]
        for step in range(self.steps):
            edges = [self.edge(step, "odom", "base_link", 0.1 * step)]
            if amcl:
                edges.append(self.edge(step, "map", "odom", 3.0))
            out += [
                (f"{self.ns}/odom", ODOM, self.odometry(step), step),
                (f"{self.ns}/scan", SCAN, self.scan(step), step),
                ("/tf", TF, self.tf(*edges), step),
            ]
            if amcl:
                out.append((f"{self.ns}/amcl_pose", POSE, self.pose(step), step))
        delay = SECOND // 100
        return [(a, b, c, self.epoch + d * SECOND // 10 + delay) for a, b, c, d in out]


@pytest.fixture
def robot(logs):
    return Robot(logs)


def bundle_of(logs, tmp_path, messages, name="log.mcap", target="out.bundle", **options):
    path = logs.write(name, messages)
    return ingest([path], tmp_path / target, IngestOptions(**options))


def losses(bundle):
    return {(entry.kind, entry.what, entry.reason): entry.count for entry in bundle.manifest.losses}


def roles(bundle):
    return {role.role: role.topic for role in bundle.manifest.roles}


@pytest.mark.parametrize("name", ["log.mcap", "log.db3", "folder_mcap", "folder_db3"])
def test_roles_frames_and_clock_of_a_plain_log(logs, robot, tmp_path, name):
    bundle = bundle_of(logs, tmp_path, robot.messages(), name)

    assert roles(bundle) == {
        "odometry": "/odom", "scan": "/scan", "pose": "/amcl_pose", "covariance": "/amcl_pose",
    }  # fmt: skip
    frames = bundle.manifest.frames
    assert (frames.map, frames.odom, frames.base) == ("map", "odom", "base_link")
    assert bundle.manifest.clock.name == "sensor"
    assert (bundle.manifest.start_ns, bundle.manifest.end_ns) == (EPOCH, EPOCH + 29 * SECOND // 10)
    assert bundle.manifest.missing_parts() == ["imu", "map", "costmap", "recovery"]
    assert len(bundle.table("scans")) == 30
    belief = recorded_belief(bundle.view(), np.array([EPOCH + SECOND]))
    np.testing.assert_allclose(belief.xyyaw[0], [4.0, 0.0, 0.0], atol=1e-12)


def test_ros1_bag_gives_the_same_rows(logs, tmp_path):
    two = ingest([logs.write("two.mcap", Robot(logs).messages())], tmp_path / "two")
    bag = logs.write("one.bag", Robot(logs, ros=1).messages(), ros=1)
    one = ingest([bag], tmp_path / "one")

    hashes = [{n: t.sha256 for n, t in b.manifest.tables.items()} for b in (one, two)]
    assert hashes[0] == hashes[1]


def test_same_log_gives_same_bytes(logs, robot, tmp_path):
    path = logs.write("log.mcap", robot.messages())
    for target in ("a", "b"):
        ingest([path], tmp_path / target)

    files = [sorted(p for p in (tmp_path / t).rglob("*") if p.is_file()) for t in ("a", "b")]
    assert [p.read_bytes() for p in files[0]] == [p.read_bytes() for p in files[1]]


def test_columns_that_wait_on_disk_give_the_same_bytes(logs, robot, tmp_path, monkeypatch):
    messages = [m for k in range(40) for m in robot.messages()[k::40]]  # not in the order of time
    paths = [logs.write("a.mcap", messages[::2]), logs.write("b.mcap", messages[1::2])]
    one = ingest(paths, tmp_path / "one" / "b")
    monkeypatch.setattr("slamreplay.ingest.collected.MEMORY_BYTES", 2000)
    monkeypatch.setattr("slamreplay.ingest.readers.windows.WINDOW_BYTES", 3000)
    files = []
    real = np.memmap
    monkeypatch.setattr(np, "memmap", lambda path, **kw: files.append(path) or real(path, **kw))

    two = ingest(paths, tmp_path / "two" / "b")

    assert files
    assert two.manifest == one.manifest
    assert [p.name for p in (tmp_path / "two").iterdir()] == ["b"]


def test_split_logs_in_any_order_are_one_log(logs, robot, tmp_path):
    messages = robot.messages()
    first, second = logs.write("1.mcap", messages[:60]), logs.write("2.mcap", messages[60:])

    whole = ingest([logs.write("whole.mcap", messages)], tmp_path / "whole")
    split = ingest([second, first, first], tmp_path / "split")

    assert split.manifest.tables == whole.manifest.tables
    assert ("skipped", "1.mcap", "the same file twice") in losses(split)


def test_sensor_clock_of_another_epoch_carries_log_times_over(logs, tmp_path):
    robot = Robot(logs, epoch=100 * SECOND)  # simulated stamps, wall-clock log times
    messages = [(a, b, c, d + EPOCH) for a, b, c, d in robot.messages()]
    twist = logs.make("geometry_msgs/msg/Twist")
    messages.append(("/cmd_vel", "geometry_msgs/msg/Twist", twist, EPOCH + 102 * SECOND))

    bundle = bundle_of(logs, tmp_path, messages)

    assert bundle.manifest.start_ns == 100 * SECOND
    (t_ns,) = bundle.table("commands").t_ns
    assert abs(t_ns - 102 * SECOND) < SECOND // 20
    assert ("repaired", "/cmd_vel") not in {k[:2] for k in losses(bundle)}


def test_stamps_of_another_clock_are_placed_by_log_time(logs, robot, tmp_path):
    messages = robot.messages()
    for _topic, kind, message, _t in messages:
        if kind == POSE:
            message.header.stamp.sec -= 10_000

    bundle = bundle_of(logs, tmp_path, messages)

    assert np.abs(bundle.table("poses").t_ns - bundle.table("odometry").t_ns).max() < SECOND // 20
    reason = "stamped by another clock (-10000 s), placed by log time"
    assert losses(bundle)["repaired", "/amcl_pose", reason] == 30


@pytest.mark.parametrize("fault", ["zero", "jump"])
def test_unusable_stamps_of_all_sensors_leave_the_log_clock(logs, robot, tmp_path, fault):
    messages = robot.messages(amcl=False)
    for index, (_topic, kind, message, _t) in enumerate(messages):
        stamps = (
            [message.header.stamp] if kind != TF else [e.header.stamp for e in message.transforms]
        )
        for stamp in stamps:
            if fault == "zero":
                stamp.sec = stamp.nanosec = 0
            elif kind != TF and index > 45:
                stamp.sec -= 20  # the sensors' clock was set back in the middle

    bundle = bundle_of(logs, tmp_path, [m for m in messages if m[1] != TF])

    assert bundle.manifest.clock.name == "log"
    assert ("zero" if fault == "zero" else "jump") in bundle.manifest.clock.reason
    np.testing.assert_array_equal(bundle.table("scans").t_ns, bundle.table("scans")["t_log_ns"])


def test_a_latched_message_of_long_ago_does_not_start_the_bundle(logs, robot, tmp_path):
    old = robot.pose(-300)
    bundle = bundle_of(logs, tmp_path, [("/initialpose", POSE, old, EPOCH), *robot.messages()])

    assert bundle.manifest.start_ns == EPOCH
    assert roles(bundle)["initial_pose"] == "/initialpose"
    assert roles(bundle)["pose"] == "/amcl_pose"


def test_references_judge_and_play_no_other_role(logs, robot, tmp_path):
    messages = robot.messages(amcl=False)
    for step in range(30):
        t_ns = EPOCH + step * SECOND // 10
        messages += [
            ("/ground_truth/odom", ODOM, robot.odometry(step, "map"), t_ns),
            ("/slamreplay/reference", ODOM, robot.odometry(step, "map"), t_ns),
            ("/vicon/robot/pose", STAMPED, robot.pose(step, kind=STAMPED), t_ns),
        ]

    bundle = bundle_of(logs, tmp_path, messages)

    table = bundle.table("references")
    kinds = {t: set(table["kind"][table["topic"] == t]) for t in set(table["topic"])}
    assert kinds == {
        "/slamreplay/reference": {"simulation"},
        "/ground_truth/odom": {"motion_capture"},
        "/vicon/robot/pose": {"motion_capture"},
    }
    assert "pose" not in roles(bundle)
    assert roles(bundle)["odometry"] == "/odom"
    assert len(bundle.view().table("references")) == 0


def test_removing_the_reference_changes_nothing_else(logs, robot, tmp_path):
    plain = robot.messages()
    extra = [("/slamreplay/reference", ODOM, robot.odometry(s, "map"), EPOCH + s * SECOND // 10)
             for s in range(30)]  # fmt: skip
    one = bundle_of(logs, tmp_path, plain, "a.mcap", "a")
    two = bundle_of(logs, tmp_path, [*plain, *extra], "b.mcap", "b")

    assert one.manifest.clock == two.manifest.clock
    assert one.manifest.frames == two.manifest.frames
    differing = {n for n, t in two.manifest.tables.items() if t != one.manifest.tables[n]}
    assert differing == {"references"}


def test_tf_frame_that_repeats_a_reference_is_not_the_belief(logs, robot, tmp_path):
    messages = robot.messages(amcl=False)
    for step in range(30):
        t_ns = EPOCH + step * SECOND // 10
        edges = [robot.edge(step, "odom", "map", -1.0), robot.edge(step, "odom", "map_filter", 2.0)]
        truth = robot.pose(step, x=0.1 * step + 1.0, kind=STAMPED)
        messages += [("/tf", TF, robot.tf(*edges), t_ns), ("/mocap/pose", STAMPED, truth, t_ns)]

    bundle = bundle_of(logs, tmp_path, messages)

    assert bundle.manifest.frames.map == "map_filter"
    belief = recorded_belief(bundle.view(), np.array([EPOCH + SECOND]))
    np.testing.assert_allclose(belief.xyyaw[0, :2], [-1.0, 0.0], atol=1e-9)
    reason = "repeats the reference /mocap/pose, which only judges"
    assert losses(bundle)["skipped", "tf frame map", reason] == 30


def test_map_above_odom_and_below_it_are_found(logs, robot, tmp_path):
    messages = robot.messages(amcl=False)
    messages += [("/tf", TF, robot.tf(robot.edge(s, "odom", "map", -3.0)),
                  EPOCH + s * SECOND // 10) for s in range(30)]  # fmt: skip

    bundle = bundle_of(logs, tmp_path, messages)

    assert bundle.manifest.frames.map == "map"
    assert roles(bundle)["pose"] == "/tf"
    assert bundle.view().role("pose") is not None
    belief = recorded_belief(bundle.view(), np.array([EPOCH + SECOND]))
    np.testing.assert_allclose(belief.xyyaw[0], [4.0, 0.0, 0.0], atol=1e-9)


def test_frames_of_tf_go_before_those_a_driver_makes_up(logs, robot, tmp_path):
    messages = robot.messages()
    for _topic, kind, message, _t in messages:
        if kind == ODOM:
            message.header.frame_id, message.child_frame_id = "wheel_odom", ""

    frames = bundle_of(logs, tmp_path, messages).manifest.frames

    assert (frames.map, frames.odom, frames.base) == ("map", "odom", "base_link")


def test_slam_without_an_odom_frame_is_a_belief_too(logs, robot, tmp_path):
    messages = [m for m in robot.messages(amcl=False) if m[1] == SCAN]
    messages += [("/tf", TF, robot.tf(robot.edge(s, "map", "base_link", 0.1 * s)),
                  EPOCH + s * SECOND // 10) for s in range(30)]  # fmt: skip

    bundle = bundle_of(logs, tmp_path, messages)

    assert roles(bundle)["pose"] == "/tf"
    assert set(bundle.table("poses")["source"]) == {"tf"}
    belief = recorded_belief(bundle.view(), np.array([EPOCH + SECOND]))
    np.testing.assert_allclose(belief.xyyaw[0], [1.0, 0.0, 0.0], atol=1e-9)
    assert "odometry" in bundle.manifest.missing_parts()


def test_second_parents_and_cycles_are_left_out_with_a_reason(logs, robot, tmp_path):
    messages = robot.messages()
    odd = robot.tf(robot.edge(1, "camera", "base_link"), robot.edge(1, "laser", "map"))
    messages.append(("/tf", TF, odd, EPOCH + SECOND))

    bundle = bundle_of(logs, tmp_path, messages)

    assert bundle.view().transforms.has_path("map", "laser")
    lost = {k[1]: k[2] for k in losses(bundle) if k[0] == "skipped"}
    assert lost["tf camera -> base_link"] == "a second parent of base_link, odom is kept"
    assert "closes a cycle" in lost["tf laser -> map"]
    left = {(e.parent, e.child): (e.fault, e.samples) for e in bundle.manifest.frames.left_out}
    assert left == {("camera", "base_link"): ("second parent", 1), ("laser", "map"): ("cycle", 1)}


def test_two_parents_that_are_all_tf_has_do_not_upset_it(logs, robot, tmp_path):
    edges = robot.tf(robot.edge(0, "odom", "base_link"), robot.edge(0, "map", "base_link"))
    messages = [("/tf", TF, edges, EPOCH), ("/odom", ODOM, robot.odometry(0), EPOCH)]

    bundle = bundle_of(logs, tmp_path, messages)

    assert len(bundle.view().transforms.edges) == 1


def test_fixed_edges_of_tf_are_held_at_all_times(logs, robot, tmp_path):
    messages = [m for m in robot.messages() if m[0] != "/tf_static"]
    fixed = robot.tf(robot.edge(5, "base_link", "laser", 0.2))
    messages += [("/tf", TF, fixed, EPOCH + k) for k in range(2)]

    bundle = bundle_of(logs, tmp_path, messages)

    _, valid = bundle.view().transforms.lookup("base_link", "laser", np.array([EPOCH]))
    assert valid.all()
    assert losses(bundle)["repaired", "tf", "1 edge never changes: held at all times"] == 2


def test_densest_of_two_lasers_and_plainer_of_two_alike(logs, robot, tmp_path):
    messages = robot.messages()
    for s in range(30):
        t_ns = EPOCH + s * SECOND // 10
        messages += [("/front/laser", SCAN, robot.scan(s, 80), t_ns),
                     ("/front/scan", SCAN, robot.scan(s, 79), t_ns)]  # fmt: skip

    bundle = bundle_of(logs, tmp_path, messages)

    scan = next(r for r in bundle.manifest.roles if r.role == "scan")
    assert scan.topic == "/front/scan"
    assert "densest of 3 lasers" in scan.reason


def test_goals_are_no_beliefs(logs, robot, tmp_path):
    messages = robot.messages(amcl=False)
    messages.append(("/goal_pose", STAMPED, robot.pose(3, kind=STAMPED), EPOCH + SECOND))

    bundle = bundle_of(logs, tmp_path, messages)

    assert len(bundle.table("poses")) == 0
    assert ("skipped", "/goal_pose", "a pose, but not the robot's in a map") in losses(bundle)


def grid_message(robot, step, cells):
    return robot.stamped(
        GRID, step, header__frame_id="map", info__resolution=float(np.float32(0.05)),
        info__width=2, info__height=2, info__origin__orientation__w=1.0, data=np.int8(cells),
    )  # fmt: skip


def test_maps_of_the_log_become_versions_and_the_latest_is_active(logs, robot, tmp_path):
    messages = robot.messages()
    messages += [("/map", GRID, grid_message(robot, t, [0, 100, -1, cell]), EPOCH + t)
                 for t, cell in enumerate((0, 1, 0))]  # fmt: skip
    costmap = grid_message(robot, 1, [0, 0, 0, 99])
    messages += [("/local_costmap/costmap", GRID, costmap, EPOCH + SECOND)]

    bundle = bundle_of(logs, tmp_path, messages)

    assert bundle.grid().cells.tolist() == [[0, 100], [-1, 0]]
    assert bundle.grid().resolution_m == 0.05
    assert len(bundle.manifest.maps) == 2
    assert bundle.table("map_updates")["map_version"][-1] == bundle.manifest.maps[-1].version
    assert roles(bundle)["costmap"] == "/local_costmap/costmap"
    assert len(bundle.table("costmaps")) == 1


def write_map(folder, image=True):
    if image:
        (folder / "m.pgm").write_bytes(b"P5\n2 1\n255\n" + bytes([0, 254]))
    meta = {"image": "m.pgm", "resolution": 0.1, "origin": [1.0, 2.0, 0.5], "negate": 0}
    (folder / "m.yaml").write_text(yaml.safe_dump(meta))
    return folder / "m.yaml"


def test_map_from_a_yaml_wins_over_the_logs_own(logs, robot, tmp_path):
    messages = [*robot.messages(), ("/map", GRID, grid_message(robot, 0, [0] * 4), EPOCH)]

    bundle = bundle_of(logs, tmp_path, messages, map=write_map(tmp_path))

    assert bundle.grid().origin_xyyaw.tolist() == [1.0, 2.0, 0.5]
    assert roles(bundle)["map"] == "m.yaml"
    assert ("skipped", "/map", "the map given with --map is used instead") in losses(bundle)
    assert "map_server" in {s.format for s in bundle.manifest.sources}


def test_topics_file_overrides_and_is_strict(logs, robot, tmp_path):
    messages = robot.messages()
    messages += [("/other", SCAN, robot.scan(s, 3), EPOCH + s * SECOND // 10) for s in range(30)]
    path = logs.write("log.mcap", messages)
    topics = tmp_path / "topics.yaml"

    topics.write_text("scan: /other\nmap_frame: world\n")
    bundle = ingest([path], tmp_path / "b", IngestOptions(topics=topics))
    assert roles(bundle)["scan"] == "/other"
    assert bundle.manifest.frames.map == "world"

    for text, said in (
        ("scam: /other", "there is no role 'scam'.*did you mean 'scan'"),
        ("scan: /othr", "no topic '/othr'.*did you mean '/other'"),
        ("scan: /odom", "Odometry cannot play scan"),
        ("[1, 2]", "ROLE: TOPIC"),
        ("scan: {", "cannot read the topics file"),
    ):
        topics.write_text(text)
        with pytest.raises(UsageError, match=said):
            ingest([path], tmp_path / "c", IngestOptions(topics=topics))
    assert not (tmp_path / "c").exists()


def test_robot_picks_a_namespace_and_strips_frames(logs, tmp_path):
    one = Robot(logs, "/r1", "r1/", steps=20).messages(amcl=False)
    two = Robot(logs, "/r2", "r2/").messages(amcl=False)

    bundle = bundle_of(logs, tmp_path, [*one, *two], robot="r1")

    assert roles(bundle)["odometry"] == "/r1/odom"
    assert bundle.manifest.frames.base == "base_link"
    assert len(bundle.table("scans")) == 20
    assert losses(bundle)["skipped", "/r2/scan (sensor_msgs/msg/LaserScan)", "not of robot r1"]
    with pytest.raises(UsageError, match="holds 2 robots: r1, r2"):
        bundle_of(logs, tmp_path, [*one, *two], "both.mcap")
    with pytest.raises(UsageError, match="there are: r1, r2"):
        bundle_of(logs, tmp_path, [*one, *two], "again.mcap", robot="r3")


@pytest.mark.parametrize(
    "text",
    [
        "# t x y z qx qy qz qw\n1700000001.123456789 1 2 0 0 0 0 1\n",
        "t_ns,x,y,yaw\n1700000001123456789,1,2,0.0\n",
        "timestamp;x;y;theta\n1700000001.123456789;1;2;0\n",
    ],
)
def test_reference_file_is_read_to_the_nanosecond(logs, robot, tmp_path, text):
    reference = tmp_path / "gt.txt"
    reference.write_text(text)

    bundle = bundle_of(logs, tmp_path, robot.messages(), reference=reference)

    table = bundle.table("references")
    assert table.t_ns.tolist() == [1_700_000_001_123_456_789]
    assert table["position_xyz"].tolist() == [[1.0, 2.0, 0.0]]
    assert table["kind"].tolist() == ["survey"]
    assert roles(bundle)["reference"] == "gt.txt"


@pytest.mark.parametrize("text", ["", "1 2 3\n", "t,x\n1,2\n", "1 2 3 4 5 6 7 x\n"])
def test_reference_file_without_poses_is_refused(logs, robot, tmp_path, text):
    reference = tmp_path / "gt.txt"
    reference.write_text(text)

    with pytest.raises(LogError):
        bundle_of(logs, tmp_path, robot.messages(), reference=reference)


def test_start_and_end_cut_but_keep_what_still_holds(logs, robot, tmp_path):
    messages = robot.messages()
    messages.append(("/map", GRID, grid_message(robot, 0, [0] * 4), EPOCH))

    bundle = bundle_of(logs, tmp_path, messages, start_s=1.0, end_s=2.0)

    assert bundle.manifest.start_ns == EPOCH + SECOND
    assert bundle.manifest.end_ns == EPOCH + 2 * SECOND
    assert len(bundle.table("scans")) == 11
    assert len(bundle.table("map_updates")) == 1
    assert bundle.view().transforms.has_path("map", "laser")
    with pytest.raises(UsageError, match=r"--end 2\.9.*lasts 2\.9 s"):
        bundle_of(logs, tmp_path, messages, "again.mcap", start_s=5.0)


def test_broken_messages_and_unknown_types_are_counted(logs, robot, tmp_path):
    messages = robot.messages()
    text = logs.make("std_msgs/msg/String", data="x" * 50)
    messages += [("/chatter", "std_msgs/msg/String", text, EPOCH + SECOND)] * 3
    path = logs.write("log.db3", messages)
    import sqlite3

    with sqlite3.connect(path) as database:
        (topic,) = database.execute("SELECT id FROM topics WHERE name = '/scan'").fetchone()
        rows = database.execute("SELECT id FROM messages WHERE topic_id = ?", [topic]).fetchall()
        database.execute("UPDATE messages SET data = x'00010000ff' WHERE id = ?", rows[4])
    database.close()

    bundle = ingest([path], tmp_path / "b")

    assert len(bundle.table("scans")) == 29
    found = losses(bundle)
    assert found["skipped", "/chatter (std_msgs/msg/String)", "no decoder for this type"] == 3
    assert [c for (k, w, _), c in found.items() if (k, w) == ("lost", "/scan")] == [1]


def test_a_type_that_a_log_defines_differently_is_lost_with_a_reason(logs, robot, tmp_path):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("float64 yaw", IMU))
    logs.stores[3] = store
    odd = logs.write("odd.mcap", [("/imu", IMU, logs.make(IMU, 3, yaw=1.0), EPOCH)], ros=3)

    bundle = ingest([odd, logs.write("log.mcap", robot.messages())], tmp_path / "b")

    (lost,) = [entry for entry in bundle.manifest.losses if entry.kind == "lost"]
    assert (lost.what, lost.count) == ("/imu", 1)
    assert "its definition is another one" in lost.reason


def text_as_bag(tmp_path, logs, robot):
    (tmp_path / "a.bag").write_text("these are my notes\n")
    return [tmp_path / "a.bag"], IngestOptions()


def empty_file(tmp_path, logs, robot):
    (tmp_path / "a.mcap").touch()
    return [tmp_path / "a.mcap"], IngestOptions()


def nothing_there(tmp_path, logs, robot):
    return [tmp_path / "no.mcap"], IngestOptions()


def empty_folder(tmp_path, logs, robot):
    (tmp_path / "empty").mkdir()
    return [tmp_path / "empty"], IngestOptions()


def no_scan_no_odometry(tmp_path, logs, robot):
    text = logs.make("std_msgs/msg/String", data="hello")
    return [logs.write("a.mcap", [("/chatter", "std_msgs/msg/String", text, 1)])], IngestOptions()


def only_an_imu(tmp_path, logs, robot):
    imu = robot.stamped(IMU, 1)
    return [logs.write("a.mcap", [("/imu", IMU, imu, EPOCH)])], IngestOptions()


def other_sqlite(tmp_path, logs, robot):
    import sqlite3

    with sqlite3.connect(tmp_path / "a.db3") as database:
        database.execute("CREATE TABLE recipes (name TEXT)")
    database.close()
    return [tmp_path / "a.db3"], IngestOptions()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (text_as_bag, "a.bag: not a log that is known here"),
        (empty_file, "the file is empty"),
        (nothing_there, "no such file or folder"),
        (empty_folder, "a folder without a storage file"),
        (no_scan_no_odometry, "no scan and no odometry"),
        (only_an_imu, "no scan and no odometry"),
        (other_sqlite, "not of rosbag2"),
    ],
)
def test_bad_logs_give_one_line_and_leave_nothing(logs, robot, tmp_path, make, said):
    paths, options = make(tmp_path, logs, robot)
    before = sorted(tmp_path.iterdir())

    with pytest.raises(LogError, match=said) as caught:
        ingest(paths, tmp_path / "out" / "b", options)

    assert "\n" not in str(caught.value)
    assert sorted(tmp_path.iterdir()) == before


def test_map_without_its_image_gives_one_line(logs, robot, tmp_path):
    yaml_path = write_map(tmp_path, image=False)

    with pytest.raises(MapError, match=r"its image 'm\.pgm' is missing"):
        bundle_of(logs, tmp_path, robot.messages(), map=yaml_path)
    assert not (tmp_path / "out.bundle").exists()


def test_unwritable_output_gives_one_line(logs, robot, tmp_path):
    (tmp_path / "file").touch()

    with pytest.raises(OutputError, match="cannot write"):
        bundle_of(logs, tmp_path, robot.messages(), target="file/b.bundle")


@pytest.mark.parametrize("name", ["log.mcap", "one.bag", "log.db3"])
def test_a_cut_log_is_read_up_to_the_cut(logs, tmp_path, name):
    ros = 1 if name.endswith(".bag") else 2
    robot = Robot(logs, ros=ros)
    scans = [("/scan", SCAN, robot.scan(s, 2000), EPOCH + s * SECOND // 10) for s in range(400)]
    path = logs.write(name, scans, ros=ros)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 6 // 10])

    bundle = ingest([path], tmp_path / "b")
    assert 0 < len(bundle.table("scans")) < 400
    lost = [entry for entry in bundle.manifest.losses if entry.kind == "lost"]
    assert any("cut" in entry.reason for entry in lost)
    assert {entry.last_good_ns for entry in lost} == {bundle.table("scans")["t_log_ns"].max()}


@pytest.mark.parametrize("name", ["log.mcap", "one.bag", "log.db3"])
def test_flipped_bytes_never_give_a_traceback(logs, tmp_path, name):
    ros = 1 if name.endswith(".bag") else 2
    path = logs.write(name, Robot(logs, steps=3, ros=ros).messages(), ros=ros)
    whole = path.read_bytes()
    rng = np.random.default_rng(7)
    for _ in range(12):
        damaged = bytearray(whole)
        for position in rng.integers(len(whole), size=5):
            damaged[position] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        with contextlib.suppress(SlamreplayError):
            ingest([path], tmp_path / "b")


def test_inspect_answers_for_everything(logs, robot, tmp_path):
    bundle = bundle_of(logs, tmp_path, robot.messages())

    answers = inspect(bundle)

    assert json.loads(json.dumps(answers, allow_nan=False)) == answers
    assert {r["role"]: r["rate_hz"] for r in answers["roles"]}["scan"] == pytest.approx(10.0)
    assert [m["part"] for m in answers["missing"]] == ["imu", "map", "costmap", "recovery"]
    (scan,) = [t for t in answers["clock"]["topics"] if t["topic"] == "/scan"]
    assert scan["log_minus_stamp_median_s"] == pytest.approx(0.01)
    assert answers["frames"]["without_tf"] == []
    assert answers["tables"]["scans"] == 30


def test_format_page_is_the_schemas(request):
    page = request.config.rootpath / "slamreplay" / "bundle" / "FORMAT.md"
    assert page.read_text(encoding="utf-8") == format_page()


@pytest.mark.parametrize("metadata", ["kept", "gone", "wrong"])
@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_compressed_folders_are_read_whatever_their_metadata_says(
    logs, robot, tmp_path, storage, mode, metadata
):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store, connections = logs.stores[2], {}
    writer = Writer(tmp_path / "packed", version=9, storage_plugin=StoragePlugin[storage])
    writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        for topic, kind, message, t_ns in robot.messages():
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], t_ns, store.serialize_cdr(message, kind))
    about = tmp_path / "packed" / "metadata.yaml"
    if metadata == "gone":
        about.unlink()
    elif metadata == "wrong":
        about.write_text(about.read_text().replace("zstd", "").replace("message_count:", "n:"))

    packed = ingest([tmp_path / "packed"], tmp_path / "packed.bundle")
    plain = ingest([logs.write("plain.mcap", robot.messages())], tmp_path / "plain.bundle")

    for name, entry in plain.manifest.tables.items():
        assert packed.manifest.tables[name] == entry, name


def test_a_compressed_message_that_is_damaged_is_counted(logs, robot, tmp_path):
    import sqlite3

    import zstandard

    path = logs.write("log.db3", robot.messages())
    with sqlite3.connect(path) as database:
        rows = database.execute("SELECT id, data FROM messages").fetchall()
        for number, data in rows:
            packed = bytearray(zstandard.compress(data))
            packed[6] ^= 0xFF if number == rows[5][0] else 0
            database.execute("UPDATE messages SET data = ? WHERE id = ?", [bytes(packed), number])
    database.close()

    lost = [x for x in ingest([path], tmp_path / "b").manifest.losses if x.kind == "lost"]

    assert sum(x.count for x in lost) == 1
