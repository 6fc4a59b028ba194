"""One robot of a log that several share: its topics, its frames, and nobody else's."""

from itertools import product

import numpy as np
import pytest

from slamreplay.bundle.belief import recorded_belief
from slamreplay.errors import UsageError
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
ODOM, SCAN, TF = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"
POSE, GRID = "geometry_msgs/msg/PoseWithCovarianceStamped", "nav_msgs/msg/OccupancyGrid"
STAMPED = "geometry_msgs/msg/PoseStamped"
STEPS = 20


class Fleet:
    """Messages of robots that drive at 1 m/s, each from a place of its own."""

    def __init__(self, logs):
        self.logs = logs

    def stamped(self, kind, step, **values):
        t = EPOCH + step * SECOND // 10
        stamp = {"header__stamp__sec": t // SECOND, "header__stamp__nanosec": t % SECOND}
        return self.logs.make(kind, **stamp, **values), t

    def edge(self, topic, step, parent, child, x=0.0):
        edge, t = self.stamped(
            "geometry_msgs/msg/TransformStamped", step, header__frame_id=parent,
            child_frame_id=child, transform__translation__x=x, transform__rotation__w=1.0,
        )  # fmt: skip
        return topic, TF, self.logs.make(TF, transforms=[edge]), t

    def robot(self, ns, prefix, tf="/tf", x=0.0, mounted=0.2):
        """Odometry, a laser `mounted` m ahead, tf, and a localizer that puts the start at `x`."""
        out = [self.edge(f"{tf}_static", 0, f"{prefix}base_link", f"{prefix}laser", mounted)]
        for step in range(STEPS):
            odometry, t = self.stamped(
                ODOM, step, header__frame_id=f"{prefix}odom", child_frame_id=f"{prefix}base_link",
                pose__pose__position__x=0.1 * step, pose__pose__orientation__w=1.0,
            )  # fmt: skip
            scan, _ = self.stamped(
                SCAN, step, header__frame_id=f"{prefix}laser", angle_increment=0.1, range_max=9.0,
                ranges=np.full(8, 2.0 + x, np.float32),
            )  # fmt: skip
            out += [
                (f"{ns}/odom", ODOM, odometry, t),
                (f"{ns}/scan", SCAN, scan, t),
                self.edge(tf, step, f"{prefix}odom", f"{prefix}base_link", 0.1 * step),
                self.edge(tf, step, "map", f"{prefix}odom", x),
            ]
        return out

    def grid(self, topic, width=2):
        grid, t = self.stamped(
            GRID, 0, header__frame_id="map", info__resolution=0.5, info__width=width,
            info__height=1, info__origin__orientation__w=1.0, data=np.zeros(width, np.int8),
        )  # fmt: skip
        return topic, GRID, grid, t


@pytest.fixture
def fleet(logs):
    return Fleet(logs)


def bundle_of(logs, tmp_path, messages, robot, name="log.mcap"):
    return ingest([logs.write(name, messages)], tmp_path / "b", IngestOptions(robot=robot))


def roles(bundle):
    return {role.role: role.topic for role in bundle.manifest.roles}


def reasons(bundle):
    return {x.what.partition(" (")[0]: x.reason for x in bundle.manifest.losses}


def check(bundle, ns, x):
    """Everything is the robot's that starts at x."""
    assert roles(bundle)["odometry"] == f"{ns}/odom"
    assert roles(bundle)["scan"] == f"{ns}/scan"
    frames = bundle.manifest.frames
    assert (frames.map, frames.odom, frames.base) == ("map", "odom", "base_link")
    assert {f for e in frames.tree for f in (e.parent, e.child)} == {
        "map", "odom", "base_link", "laser",
    }  # fmt: skip
    scans = bundle.view().role("scan")
    assert set(scans["frame_id"]) == {"laser"}
    assert scans["ranges_m"][0][0] == np.float32(2.0 + x)
    belief = recorded_belief(bundle.view(), np.array([EPOCH + SECOND]))
    np.testing.assert_allclose(belief.xyyaw[0], [x + 1.0, 0.0, 0.0], atol=1e-9)
    T, valid = bundle.view().transforms.lookup("base_link", "laser", np.array([EPOCH + SECOND]))
    assert valid.all()
    np.testing.assert_allclose(T[0, 0, 3], 0.2)


@pytest.mark.parametrize("robot", ["robot1", "/robot1", "robot2"])
@pytest.mark.parametrize("prefixed", [True, False])
def test_tf_inside_the_namespace(logs, fleet, tmp_path, robot, prefixed):
    messages = []
    for k in (1, 2):
        ns = f"/robot{k}"
        messages += fleet.robot(ns, f"robot{k}/" if prefixed else "", f"{ns}/tf", 5.0 * k)

    bundle = bundle_of(logs, tmp_path, messages, robot)

    number = int(robot[-1])
    check(bundle, f"/robot{number}", 5.0 * number)
    other = f"/robot{3 - number}/tf_static"
    assert reasons(bundle)[other] == f"not of robot robot{number}"


@pytest.mark.parametrize("robot", ["robot1", "robot2"])
def test_a_tf_that_robots_share_is_the_robots_alone(logs, fleet, tmp_path, robot):
    messages = []
    for k in (1, 2):
        messages += fleet.robot(f"/robot{k}", f"robot{k}/", "/tf", 5.0 * k)

    bundle = bundle_of(logs, tmp_path, messages, robot)

    number = int(robot[-1])
    check(bundle, f"/{robot}", 5.0 * number)
    assert reasons(bundle)["tf"] == f"frames of other robots: robot{3 - number}"
    (loss,) = [x for x in bundle.manifest.losses if x.what == "tf"]
    assert loss.count == 2 * STEPS + 1


def test_frames_of_a_robot_whose_topics_were_not_recorded(logs, fleet, tmp_path):
    messages = fleet.robot("/robot1", "robot1/", "/tf", 5.0)
    for step in range(STEPS):
        messages += [
            fleet.edge("/tf", step, "map", "robot2/odom", 9.0),
            fleet.edge("/tf", step, "robot2/odom", "robot2/base_footprint", 0.3 * step),
        ]

    check(bundle_of(logs, tmp_path, messages, "robot1"), "/robot1", 5.0)


def test_a_prefix_that_is_not_the_namespace_is_the_robots_own(logs, fleet, tmp_path):
    messages = fleet.robot("/robot1", "r1/", "/tf", 5.0) + fleet.robot("/robot2", "r2/", "/tf", 9.0)

    bundle = bundle_of(logs, tmp_path, messages, "robot1")

    frames = bundle.manifest.frames
    assert (frames.odom, frames.base) == ("r1/odom", "r1/base_link")
    assert not [e for e in frames.tree if "r2/" in e.child]


def test_topics_without_a_namespace_give_way_to_the_robots_own(logs, fleet, tmp_path):
    messages = fleet.robot("/robot1", "robot1/", "/tf", 5.0)
    messages += fleet.robot("/robot2", "robot2/", "/tf", 9.0)
    stranger = [(t.replace("/odom", "/odometry"), *rest) for t, *rest in fleet.robot("", "odd_")]
    messages += [m for m in stranger if m[1] != TF]
    messages += [fleet.grid("/map"), fleet.grid("/map_of_all", 3)]

    bundle = bundle_of(logs, tmp_path, messages, "robot1")

    check(bundle, "/robot1", 5.0)
    assert roles(bundle)["map"] == "/map"
    assert reasons(bundle)["/odometry"] == "robot robot1 has its own"
    assert reasons(bundle)["/scan"] == "robot robot1 has its own"


def test_topics_without_a_namespace_are_used_where_the_robot_has_none(logs, fleet, tmp_path):
    messages = fleet.robot("/robot1", "robot1/", "/tf", 5.0)
    pose, t = fleet.stamped(POSE, 3, header__frame_id="map", pose__pose__orientation__w=1.0)
    messages.append(("/amcl_pose", POSE, pose, t))

    bundle = bundle_of(logs, tmp_path, messages, "robot1")

    assert roles(bundle)["pose"] == "/amcl_pose"


@pytest.mark.parametrize(
    ("prefix", "tf"),
    [("", "/fleet/robot{}/tf"), *product(["fleet/robot{}/", "robot{}/"],
                                         ["/tf", "/fleet/tf", "/fleet/robot{}/tf"])],
)  # fmt: skip
def test_a_namespace_of_two_parts(logs, fleet, tmp_path, prefix, tf):
    messages = []
    for k in (1, 2):
        messages += fleet.robot(f"/fleet/robot{k}", prefix.format(k), tf.format(k), 5.0 * k)
    messages += [fleet.grid("/fleet/map"), fleet.grid("/other/map", 3)]

    bundle = bundle_of(logs, tmp_path, messages, "fleet/robot2")

    check(bundle, "/fleet/robot2", 10.0)
    assert roles(bundle)["map"] == "/fleet/map"
    assert reasons(bundle)["/other/map"] == "not of robot fleet/robot2"
    assert reasons(bundle)["/fleet/robot1/scan"] == "not of robot fleet/robot2"


def test_robots_in_a_common_namespace_are_told_apart(logs, fleet, tmp_path):
    messages = fleet.robot("/fleet/robot1", "") + fleet.robot("/fleet/robot2", "")

    with pytest.raises(UsageError, match="holds 2 robots: fleet/robot1, fleet/robot2") as caught:
        bundle_of(logs, tmp_path, messages, None)
    assert "--robot fleet/robot1" in str(caught.value)
    with pytest.raises(UsageError, match="there are: fleet, fleet/robot1, fleet/robot2"):
        bundle_of(logs, tmp_path, messages, "robot3", "again.mcap")


def test_lasers_and_a_base_in_namespaces_are_one_robot(logs, fleet, tmp_path):
    messages = []
    for topic, kind, message, t in fleet.robot("", ""):
        topics = {SCAN: ["/front/scan", "/rear/scan"], ODOM: ["/base/odom"]}.get(kind, [topic])
        messages += [(name, kind, message, t) for name in topics]

    bundle = bundle_of(logs, tmp_path, messages, None)

    assert roles(bundle)["odometry"] == "/base/odom"


def test_a_reference_named_after_the_robot_judges_it(logs, fleet, tmp_path):
    messages = fleet.robot("/robot1", "robot1/", "/tf", 5.0)
    for step in range(STEPS):
        pose, t = fleet.stamped(STAMPED, step, header__frame_id="world",
                                pose__orientation__w=1.0)  # fmt: skip
        messages += [(f"/vrpn_client_node/robot{k}/pose", STAMPED, pose, t) for k in (1, 2)]

    bundle = bundle_of(logs, tmp_path, messages, "robot1")

    assert roles(bundle)["reference"] == "/vrpn_client_node/robot1/pose"
    assert set(bundle.table("references")["topic"]) == {"/vrpn_client_node/robot1/pose"}
