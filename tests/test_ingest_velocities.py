"""Velocities: told to the base, or measured."""

import numpy as np
import pytest
from payloads import read_back

from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
ODOM = "nav_msgs/msg/Odometry"
STAMPED, COVARIANT = (
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/TwistWithCovarianceStamped",
)
TWIST, DRIVE = "geometry_msgs/msg/Twist", "ackermann_msgs/msg/AckermannDriveStamped"


def test_twist_with_covariance_keeps_its_frame_and_covariance(logs):
    def make(ros):
        good = logs.make(
            COVARIANT, ros, header__frame_id="/base_link", header__stamp__sec=3,
            twist__twist__linear__x=0.5, twist__covariance=np.arange(36.0),
        )  # fmt: skip
        return [good, logs.make(COVARIANT, ros, twist__twist__angular__z=float("nan"))]

    rows, told = read_back(logs, COVARIANT, make)

    assert (rows.table, rows.frame(), len(rows)) == ("velocities", "base_link", 1)
    np.testing.assert_array_equal(rows.columns["twist_covariance"][0], np.arange(36.0))
    assert rows.t_sensor_ns.tolist() == [3 * SECOND]
    assert told == {("lost", "velocity is not finite"): 1}


def test_a_steering_angle_tells_no_turn_rate_without_a_wheelbase(logs):
    def make(ros):
        pairs = ((1.0, 0.0), (1.0, 0.3), (0.0, 0.3), (float("nan"), 0.0))
        return [logs.make(DRIVE, ros, drive__speed=v, drive__steering_angle=a) for v, a in pairs]

    rows, told = read_back(logs, DRIVE, make)

    assert rows.table == "commands"
    assert rows.columns["linear_velocity_xyz"][:, 0].tolist() == [1.0, 1.0, 0.0]
    np.testing.assert_array_equal(rows.columns["angular_velocity_xyz"][:, 2], [0.0, np.nan, 0.0])
    assert told == {("lost", "velocity is not finite"): 1}


@pytest.fixture
def log(logs):
    """Odometry, twists of all kinds, and two that somebody asked for."""
    messages = []
    for k in range(5):
        t = EPOCH + k * SECOND // 10
        stamp = {"header__stamp__sec": t // SECOND, "header__stamp__nanosec": t % SECOND}
        odometry = logs.make(ODOM, header__frame_id="odom", child_frame_id="base_link",
                             pose__pose__orientation__w=1.0, **stamp)  # fmt: skip
        frame = {"header__frame_id": "base_link"}
        messages += [
            ("/odom", ODOM, odometry, t),
            ("/wheel_twist", STAMPED, logs.make(STAMPED, **stamp, **frame), t),
            ("/vehicle/twist", COVARIANT, logs.make(COVARIANT, **stamp, **frame), t),
            ("/joy_vel", STAMPED, logs.make(STAMPED, **stamp, twist__linear__x=0.3), t),
            ("/base/cmd_vel", STAMPED, logs.make(STAMPED, **stamp, twist__linear__x=0.2), t),
            ("/vel", TWIST, logs.make(TWIST, linear__x=0.1), t),
        ]
    return logs.write("log.mcap", messages)


def roles(bundle):
    return {role.role: role.topic for role in bundle.manifest.roles}


def test_stamped_twists_are_commands_by_name_and_measurements_else(log, tmp_path):
    bundle = ingest([log], tmp_path / "b")

    assert roles(bundle) == {
        "odometry": "/odom", "command": "/base/cmd_vel", "velocity": "/vehicle/twist",
    }  # fmt: skip
    assert set(bundle.table("commands")["topic"]) == {"/joy_vel", "/base/cmd_vel", "/vel"}
    assert set(bundle.table("velocities")["topic"]) == {"/wheel_twist", "/vehicle/twist"}


def test_the_user_may_say_which_is_which(log, tmp_path):
    topics = tmp_path / "topics.yaml"
    topics.write_text("command: /wheel_twist\nvelocity: /vel\n")

    bundle = ingest([log], tmp_path / "b", IngestOptions(topics=topics))

    assert roles(bundle)["command"] == "/wheel_twist"
    assert len(bundle.view().role("command")) == 5
    measured = bundle.view().role("velocity")
    assert measured["linear_velocity_xyz"][:, 0].tolist() == [0.1] * 5
    assert set(measured["frame_id"]) == {""}
