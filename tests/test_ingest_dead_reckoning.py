"""A log without odometry, but with measured twists, is dead-reckoned; gaps are not bridged."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.geometry import se2
from slamreplay.ingest.dead_reckoning import integrate
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
STAMPED, TF = "geometry_msgs/msg/TwistStamped", "tf2_msgs/msg/TFMessage"
ODOM, SCAN = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
EDGE = "geometry_msgs/msg/TransformStamped"

rates = st.floats(-2.0, 2.0)


@given(st.lists(st.tuples(rates, rates, rates), min_size=2, max_size=8), st.integers(1, 900))
def test_arcs_are_matrix_exponentials(twists, step_ms):
    twist = np.array(twists)
    t_ns = np.arange(len(twist)) * step_ms * 1_000_000

    poses = integrate(t_ns, twist)

    T = np.eye(3)
    for x, y, turn in (twist[:-1] + twist[1:]) / 2.0 * step_ms / 1000.0:
        T = T @ expm(np.array([[0.0, -turn, x], [turn, 0.0, y], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(poses[-1, :2], T[:2, 2], atol=1e-9)
    assert abs(se2.wrap_angle(poses[-1, 2] - np.arctan2(T[1, 0], T[0, 0]))) < 1e-9


def test_a_circle_closes():
    t_ns = np.linspace(0, 10 * SECOND, 41).astype(np.int64)
    twist = np.tile([0.5, 0.0, 2 * np.pi / 10], (41, 1))

    poses = integrate(t_ns, twist)

    np.testing.assert_allclose(poses[-1], 0.0, atol=1e-9)
    radius = 0.5 / (2 * np.pi / 10)
    np.testing.assert_allclose(poses[20, :2], [0.0, 2 * radius], atol=1e-9)


class Twists:
    """Scans, and twists at 10 Hz of a robot that drives at 0.5 m/s and turns at 0.2 rad/s."""

    def __init__(self, logs):
        self.logs = logs

    def stamped(self, kind, step, **values):
        t = EPOCH + step * SECOND // 10
        stamp = {"header__stamp__sec": t // SECOND, "header__stamp__nanosec": t % SECOND}
        return self.logs.make(kind, **stamp, **values), t

    def messages(self, steps=range(30), frame="base_link", kind=STAMPED):
        out = []
        for step in range(steps.stop):
            scan, t = self.stamped(
                SCAN, step, header__frame_id="base_link", angle_increment=0.1, range_max=9.0,
                ranges=np.full(8, 2.0, np.float32),
            )  # fmt: skip
            out.append(("/scan", SCAN, scan, t))
            if step in steps:
                values = {"twist__linear__x": 0.5, "twist__angular__z": 0.2}
                twist, t = self.stamped(kind, step, header__frame_id=frame, **values)
                out.append(("/wheel_twist", kind, twist, t))
        return out

    def edge(self, step, parent, child, x=0.0):
        edge, t = self.stamped(
            EDGE, step, header__frame_id=parent, child_frame_id=child,
            transform__translation__x=x, transform__rotation__w=1.0,
        )  # fmt: skip
        return ("/tf", TF, self.logs.make(TF, transforms=[edge]), t)


@pytest.fixture
def twists(logs):
    return Twists(logs)


def bundle_of(logs, tmp_path, messages):
    return ingest([logs.write("log.mcap", messages)], tmp_path / "b")


def losses(bundle):
    return {(x.kind, x.what, x.reason): x.count for x in bundle.manifest.losses}


MADE = ("repaired", "/wheel_twist", "the log has no odometry: dead-reckoned from these twists")


def test_twists_alone_are_odometry_and_said_to_be(logs, twists, tmp_path):
    bundle = bundle_of(logs, tmp_path, twists.messages())

    roles = {r.role: (r.topic, r.reason) for r in bundle.manifest.roles}
    reason = "dead-reckoned from the velocities of geometry_msgs/TwistStamped"
    assert roles["odometry"] == ("/wheel_twist", reason)
    assert roles["velocity"][0] == "/wheel_twist"
    assert losses(bundle)[MADE] == 30
    assert "odometry" not in bundle.manifest.missing_parts()
    frames = bundle.manifest.frames
    assert (frames.odom, frames.base) == ("odom", "base_link")
    track = odometry_track(bundle.view())
    expected = [0.5 / 0.2 * np.sin(0.2), 0.5 / 0.2 * (1 - np.cos(0.2)), 0.2]
    np.testing.assert_allclose(track.at(np.array([EPOCH + SECOND])).xyyaw[0], expected, atol=1e-9)
    assert len(bundle.view().role("velocity")) == 30
    assert np.isnan(bundle.table("odometry")["pose_covariance"]).all()


def test_a_pause_is_not_bridged(logs, twists, tmp_path):
    messages = [m for m in twists.messages(range(60))
                if m[1] == SCAN or not 20 <= (m[3] - EPOCH) // (SECOND // 10) < 31]  # fmt: skip

    bundle = bundle_of(logs, tmp_path, messages)

    kept = bundle.view().role("odometry")
    assert (kept.t_ns.min(), len(kept)) == (EPOCH + 31 * SECOND // 10, 29)
    reason = "not dead-reckoned: across a pause of more than 1 s"
    assert losses(bundle)["skipped", "/wheel_twist", reason] == 20
    at = odometry_track(bundle.view()).at(np.array([EPOCH + 25 * SECOND // 10, EPOCH + SECOND]))
    assert not at.has_pose.any()


@pytest.mark.parametrize("rival", ["tf", "topic"])
def test_where_there_is_odometry_none_is_made(logs, twists, tmp_path, rival):
    messages = twists.messages()
    for step in range(30):
        if rival == "tf":
            messages.append(twists.edge(step, "odom", "base_link", 0.1 * step))
        else:
            odometry, t = twists.stamped(ODOM, step, header__frame_id="odom",
                                         child_frame_id="base_link",
                                         pose__pose__orientation__w=1.0)  # fmt: skip
            messages.append(("/odom", ODOM, odometry, t))

    bundle = bundle_of(logs, tmp_path, messages)

    assert MADE not in losses(bundle)
    assert len(bundle.table("odometry")) == (0 if rival == "tf" else 30)


@pytest.mark.parametrize("frame", ["map", "odom", "world"])
def test_velocities_along_axes_of_the_world_lead_nowhere(logs, twists, tmp_path, frame):
    bundle = bundle_of(logs, tmp_path, twists.messages(frame=frame))

    assert "odometry" in bundle.manifest.missing_parts()
    reason = "not dead-reckoned: along axes of the world, and no heading is known"
    assert losses(bundle)["skipped", "/wheel_twist", reason] == 30


def twists_of(logs, twists, velocity, turn_rate, steps=60):
    """Twists whose linear part is a function of the step and the heading."""
    out = twists.messages(range(steps))
    for _topic, kind, message, t in out:
        if kind == STAMPED:
            step = (t - EPOCH) // (SECOND // 10)
            x, y, z = velocity(step, turn_rate * 0.1 * step)
            linear = message.twist.linear
            linear.x, linear.y, linear.z = float(x), float(y), float(z)
            message.twist.angular.z = float(turn_rate)
    return out


def back_and_forth(step, heading):
    return 0.5 * (-1) ** (step // 20), 0.0, 0.0


@pytest.mark.parametrize(
    ("velocity", "turn_rate", "said"),
    [
        (lambda _, a: (0.5 * np.cos(a + 1.0), 0.5 * np.sin(a + 1.0), 0.0), 0.8, "turns with"),
        (lambda s, _: (0.5 * np.cos(s / 9), 0.5 * np.sin(s / 9), 0.0), 0.0, "tell no turn rate"),
        (lambda *_: (0.5, 0.0, 0.4), 0.1, "leave the plane"),
        (lambda *_: (0.5, 0.0, 0.02), 0.1, None),
        (back_and_forth, 0.8, None),
        (lambda *_: (0.0, 0.5, 0.0), 0.8, None),
        (lambda s, _: (0.5 * np.cos(s / 9), 0.5 * np.sin(s / 9), 0.0), 0.8, None),
        (lambda *_: (0.0, 0.0, 0.0), 0.8, None),
    ],
    ids=["world", "receiver", "flying", "bumpy", "back and forth", "sideways", "omni", "at rest"],
)
def test_velocities_that_are_no_bases_are_told_by_what_they_are(
    logs, twists, tmp_path, velocity, turn_rate, said
):
    bundle = bundle_of(logs, tmp_path, twists_of(logs, twists, velocity, turn_rate))

    found = [x.reason for x in bundle.manifest.losses if x.what == "/wheel_twist"]
    assert (MADE[2] in found) == (said is None)
    assert [r for r in found if "not dead-reckoned" in r and (said or "-") in r] == (
        [] if said is None else found
    )


def test_a_command_is_dead_reckoned_where_the_user_says_that_it_was_measured(
    logs, twists, tmp_path
):
    messages = [(t.replace("wheel_twist", "cmd_vel"), *rest) for t, *rest in twists.messages()]
    log = logs.write("log.mcap", messages)
    topics = tmp_path / "topics.yaml"
    topics.write_text("velocity: /cmd_vel\n")

    plain = ingest([log], tmp_path / "a")
    told = ingest([log], tmp_path / "b", IngestOptions(topics=topics))

    assert "odometry" in plain.manifest.missing_parts()
    assert "odometry" not in told.manifest.missing_parts()


def test_an_inertial_unit_on_a_bench_is_no_odometry(real_logs, tmp_path):
    bundle = ingest([real_logs / "fixtures/tilt_laser.bag"], tmp_path / "b")

    assert "odometry" in bundle.manifest.missing_parts()
    assert losses(bundle)["skipped", "/velocity", "not dead-reckoned: they leave the plane"] == 712


def test_corrections_of_an_odom_that_was_not_recorded_are_not_mixed_with_it(logs, twists, tmp_path):
    messages = twists.messages()
    messages += [twists.edge(step, "map", "odom", 3.0 + step) for step in range(30)]

    bundle = bundle_of(logs, tmp_path, messages)

    assert bundle.manifest.frames.odom == "dead_reckoning"
    assert recorded_belief(bundle.view(), np.array([EPOCH + SECOND])) is None


def test_a_pose_is_carried_on_by_it(logs, twists, tmp_path):
    pose, t = twists.stamped(POSE, 5, header__frame_id="map", pose__pose__position__x=3.0,
                             pose__pose__orientation__w=1.0)  # fmt: skip
    bundle = bundle_of(logs, tmp_path, [*twists.messages(), ("/amcl_pose", POSE, pose, t)])

    belief = recorded_belief(bundle.view(), np.array([EPOCH + 15 * SECOND // 10]))

    expected = [3.0 + 0.5 / 0.2 * np.sin(0.2), 0.5 / 0.2 * (1 - np.cos(0.2)), 0.2]
    np.testing.assert_allclose(belief.xyyaw[0], expected, atol=1e-9)


def test_stamps_that_jump_back_give_way_to_log_times(logs, twists, tmp_path):
    messages = twists.messages()
    for _topic, kind, message, t in messages:
        if kind == STAMPED and t > EPOCH + SECOND:
            message.header.stamp.sec -= 100

    bundle = bundle_of(logs, tmp_path, messages)

    end = odometry_track(bundle.view()).xyyaw[-1]
    np.testing.assert_allclose(end[2], 0.2 * 2.9, atol=1e-9)
