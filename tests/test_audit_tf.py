"""The tf audit: faults of the tree, of its publishers, of what it carries, and of its steps."""

import numpy as np
import pytest
from audited import edited, findings, healthy, on_edge, restamped, with_edge, with_manifest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.audit.log_audit import LogAudit
from slamreplay.audit.tf_steps import odometry_jumps
from slamreplay.bundle.manifest import LEADING_SLASH, FrameEdge, LeftOutEdge, Loss
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import START_NS

SECOND = NS_PER_S


@pytest.fixture(scope="module")
def sound():
    return healthy()


def said(bundle, id_):
    return [f for f in findings(bundle, "tf_tree", "tf_times", "tf_steps") if f[0] == id_]


def turned(edge_rows, transforms):
    """Planar poses (N, 3) of rows of tf."""
    T = se3.matrix(transforms["translation_xyz"][edge_rows], transforms["rotation_xyzw"][edge_rows])
    return se3.planar(T)


def with_poses(bundle, rows, xyyaw, **columns):
    table = bundle.table("transforms")
    translation, rotation = table["translation_xyz"].copy(), table["rotation_xyzw"].copy()
    translation[rows, :2], rotation[rows] = xyyaw[:, :2], se3.quaternion_from_yaw(xyyaw[:, 2])
    table = table.replace(translation_xyz=translation, rotation_xyzw=rotation, **columns)
    return rebuilt(bundle, {"transforms": table})


def without(bundle, name, rows):
    table = bundle.table(name)
    return rebuilt(bundle, {name: table.take(np.setdiff1d(np.arange(len(table)), rows))})


def test_a_sound_tree_is_left_alone(sound):
    assert findings(sound, "tf_tree", "tf_times", "tf_steps") == []


# --- the tree ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "words"),
    [("second parent", "frames with two parents"), ("cycle", "cycles")],
)
def test_what_was_left_out_of_the_tree_is_told(sound, fault, words):
    left = LeftOutEdge(parent="camera", child="base_link", samples=7, fault=fault, reason="why")
    frames = sound.manifest.frames.model_copy(update={"left_out": [left]})
    (found,) = said(with_manifest(sound, frames=frames), "SR-TF-001")

    assert found[1:] == ("warning", f"{words}: camera -> base_link (why)")


def test_leading_slashes_are_told(sound):
    loss = Loss(kind="repaired", what="/tf", count=12, reason=LEADING_SLASH)
    (found,) = said(with_manifest(sound, losses=[loss]), "SR-TF-001")

    assert found[1] == "info"
    assert "/tf 12 times" in found[2]


@pytest.mark.parametrize(("shift", "severity"), [(0.0, "info"), (0.1, "warning")])
def test_an_edge_both_fixed_and_moving_is_told(sound, shift, severity):
    fixed = turned(on_edge(sound, "base_link", "laser"), sound.table("transforms"))
    t = START_NS + np.arange(20) * SECOND
    both = with_edge(
        sound, "base_link", "laser", t, fixed + np.array([shift, 0, 0]), is_static=True
    )
    (found,) = said(both, "SR-TF-001")

    assert found[1] == severity
    assert "told both as fixed and as moving: base_link -> laser" in found[2]
    assert ("0.100 m apart" in found[2]) == bool(shift)


@pytest.mark.parametrize(("child", "severity"), [("laser", "warning"), ("bumper", "info")])
def test_a_fixed_transform_told_differently_is_told(sound, child, severity):
    for k in range(2):
        sound = with_edge(sound, "base_link", child, [START_NS + k * SECOND], [0.1 * k, 0, 0],
                          topic="/tf_static", is_static=True)  # fmt: skip
    (found,) = said(sound, "SR-TF-001")

    assert found[1] == severity
    assert f"base_link -> {child} (" in found[2]


def test_a_fixed_transform_told_again_is_no_fault(sound):
    fixed = turned(on_edge(sound, "base_link", "laser"), sound.table("transforms"))
    again = with_edge(sound, "base_link", "laser", [START_NS + SECOND], fixed,
                      topic="/tf_static", is_static=True)  # fmt: skip

    assert said(again, "SR-TF-001") == []


# --- two publishers ---------------------------------------------------------------------------


@given(
    apart_m=st.floats(0.2, 10.0),
    every=st.integers(1, 20),
    edge=st.sampled_from([("odom", "base_link"), ("map", "odom")]),
)
@settings(max_examples=20, deadline=None)
def test_two_publishers_that_disagree_are_found(apart_m, every, edge):
    bundle = healthy(seconds=60.0)
    table = bundle.table("transforms")
    rows = on_edge(bundle, *edge)[::every]
    other = turned(rows, table) + np.array([apart_m, 0.0, 0.0])
    second = with_edge(bundle, *edge, table["t_sensor_ns"][rows] + 1_000_000, other)
    found = said(second, "SR-TF-002")

    ((_, severity, text),) = found
    assert severity == "warning"
    assert text.startswith(" -> ".join(edge))
    assert float(text.split("between values ")[1].split(" m")[0]) == pytest.approx(apart_m, rel=0.2)


def test_two_publishers_that_agree_and_lone_outliers_are_none(sound):
    table, rows = sound.table("transforms"), on_edge(sound, "odom", "base_link")
    agree = with_edge(sound, "odom", "base_link", table["t_sensor_ns"][rows] + 1_000_000,
                      turned(rows, table))  # fmt: skip
    wild = turned(rows, table)
    wild[[100, 300]] += [3.0, 0.0, 0.0]

    assert said(agree, "SR-TF-002") == []
    assert said(with_poses(sound, rows, wild), "SR-TF-002") == []


@pytest.mark.parametrize("sigma", [0.002, 0.02, 0.2])
def test_a_noisy_publisher_is_one(sound, sigma):
    rows = on_edge(sound, "odom", "base_link")
    poses = turned(rows, sound.table("transforms"))
    noise = np.random.default_rng(0).normal(0.0, sigma, poses.shape)

    assert said(with_poses(sound, rows, poses + noise), "SR-TF-002") == []


def test_things_that_a_camera_sees_may_flip(sound):
    t = START_NS + np.arange(200) * SECOND // 10
    flips = np.zeros((200, 3))
    flips[::2, 0] = 1.0

    assert said(with_edge(sound, "laser", "tag_3", t, flips), "SR-TF-002") == []


# --- what is carried --------------------------------------------------------------------------


def test_scans_before_and_after_the_transforms(sound):
    rows = on_edge(sound, "odom", "base_link")
    (found,) = said(without(sound, "transforms", np.r_[rows[:80], rows[-40:]]), "SR-TF-003")

    assert found[1] == "warning"
    assert "40 scans come before the first one and 19 after the last, by up to 4.00 s" in found[2]


def test_a_cut_at_the_ends_is_how_logs_are(sound):
    rows = on_edge(sound, "odom", "base_link")

    assert said(without(sound, "transforms", np.r_[rows[:3], rows[-3:]]), "SR-TF-003") == []


def test_a_gap_of_a_transform_and_the_scans_in_it(sound):
    rows = on_edge(sound, "odom", "base_link")
    found = said(without(sound, "transforms", rows[200:240]), "SR-TF-003")

    assert [f[1] for f in found] == ["warning", "warning"]
    assert "20 scans fall into gaps, the widest 2.05 s" in found[0][2]
    assert "odom -> base_link at 20.0 Hz has a gap of 2.05 s at 9.9" in found[1][2]


@given(late_s=st.floats(0.25, 3.0), count=st.sampled_from([100, 801]))
@settings(max_examples=15, deadline=None)
def test_scans_that_had_to_wait_for_their_transform(late_s, count):
    bundle = healthy()
    rows = on_edge(bundle, "odom", "base_link")[:count]
    late = edited(bundle, "transforms", rows, t_log_ns=lambda t: t + int(late_s * SECOND))
    (found,) = said(late, "SR-TF-003")

    assert found[1] == "warning"
    told = float(found[2].split("up to ")[1].split(" s")[0])
    assert told == pytest.approx(late_s, abs=0.06)
    # The next one that is not late carries those before it, too.
    waited = min(count / 2, 400) if count == 801 else count / 2 - (late_s > 0.2) * 2
    assert int(found[2].split(": ")[1].split(" of")[0]) == pytest.approx(waited, abs=4)


def test_scans_that_come_when_tf_has_forgotten_theirs(sound):
    rows = np.arange(100, 110)
    late = edited(sound, "scans", rows, t_log_ns=lambda t: t + 12 * SECOND)
    (found,) = said(late, "SR-TF-003")

    assert "10 scans came when tf2 had forgotten theirs" in found[2]


# --- steps ------------------------------------------------------------------------------------


@given(
    metres=st.floats(0.25, 20.0),
    heading=st.floats(-3.1, 3.1),
    at=st.integers(20, 780),
)
@settings(max_examples=30, deadline=None)
def test_odometry_that_jumps_is_found(metres, heading, at):
    bundle = healthy()
    rows = on_edge(bundle, "odom", "base_link")
    poses = turned(rows, bundle.table("transforms"))
    poses[at:, :2] += metres * np.array([np.cos(heading), np.sin(heading)])
    (found,) = said(with_poses(bundle, rows, poses), "SR-TF-004")

    assert found[1] == "warning"
    assert "jumps 1 times" in found[2]
    assert float(found[2].split("up to ")[1].split(" m")[0]) == pytest.approx(metres, abs=0.06)
    assert float(found[2].split("(")[1].split(" s)")[0]) == pytest.approx(at * 0.05, abs=0.06)


def test_odometry_that_is_turned_in_one_step_is_found(sound):
    rows = on_edge(sound, "odom", "base_link")
    poses = turned(rows, sound.table("transforms"))
    poses[400:, 2] += 0.5

    assert "29 deg" in said(with_poses(sound, rows, poses), "SR-TF-004")[0][2]


@pytest.mark.parametrize("hz", [5.0, 10.0, 50.0, 200.0])
def test_hard_driving_is_no_jump(hz):
    # Full speed in 0.3 s, a stop in 0.2 s, a turn on the spot at 3 rad/s.
    t = np.arange(0.0, 20.0, 1.0 / hz)
    v = np.interp(t, [0, 2, 2.3, 8, 8.2, 20], [0, 0, 2.0, 2.0, 0, 0])
    w = np.interp(t, [0, 10, 10.2, 14, 14.2, 20], [0, 0, 3.0, 3.0, 0, 0])
    yaw = np.cumsum(w) / hz
    xy = np.cumsum(np.column_stack([v * np.cos(yaw), v * np.sin(yaw)]), axis=0) / hz
    noise = np.random.default_rng(0).normal(0.0, 0.005, (len(t), 3))
    track = PoseTrack.without_covariance(
        "odom", "base", (t * SECOND).astype(np.int64), np.column_stack([xy, yaw]) + noise
    )

    assert len(odometry_jumps(track)) == 0


def test_missing_odometry_is_no_jump(sound):
    rows = on_edge(sound, "odom", "base_link")

    assert said(without(sound, "transforms", rows[300:340]), "SR-TF-004") == []


def below_odom(bundle):
    """The same log with map as a child of odom."""
    rows = on_edge(bundle, "map", "odom")
    table = bundle.table("transforms")
    poses = se2.inverse(turned(rows, table))
    parents, children = table["parent_frame"].copy(), table["child_frame"].copy()
    parents[rows], children[rows] = "odom", "map"
    tree = [e if e.child != "odom" else FrameEdge(parent="odom", child="map", is_static=False,
            samples=e.samples) for e in bundle.manifest.frames.tree]  # fmt: skip
    frames = bundle.manifest.frames.model_copy(update={"tree": tree})
    swapped = with_poses(bundle, rows, poses, parent_frame=parents, child_frame=children)
    return with_manifest(swapped, frames=frames)


@pytest.mark.parametrize("form", [lambda b: b, below_odom])
@given(metres=st.floats(0.25, 5.0), turn=st.floats(-0.1, 0.1))
@settings(max_examples=10, deadline=None)
def test_a_correction_is_measured_at_the_robot(form, metres, turn):
    bundle = healthy()
    rows = on_edge(bundle, "map", "odom")
    table = bundle.table("transforms")
    poses = turned(rows, table)
    half = len(rows) // 2
    at = bundle.manifest.clock.from_log_time(table["t_log_ns"][rows[half : half + 1]])
    base = LogAudit(bundle.view()).odometry.at(at).xyyaw[0]
    # Turned about where the robot stands, and pushed from there.
    there = se2.compose(poses[half - 1], base)
    pushed = se2.compose(there, [0.0, 0.0, turn]) + np.array([metres, 0.0, 0.0])
    moved = se2.compose(pushed, se2.inverse(base))
    poses[half:] = moved
    spoilt = form(with_poses(bundle, rows, poses))
    (found,) = said(spoilt, "SR-TF-005")
    told = LogAudit(spoilt.view()).corrections

    assert found[1] == ("warning" if metres >= 0.5 else "info")
    assert float(found[2].split("at the most ")[1].split(" m")[0]) == pytest.approx(
        metres, abs=0.05
    )
    assert told.at_robot.metres.max() == pytest.approx(metres, abs=0.03)
    origin = np.hypot(*(moved - turned(rows, table)[half - 1])[:2])
    assert told.at_origin.max() == pytest.approx(origin, abs=0.03)


def test_a_turn_far_from_the_origin_hardly_moves_the_robot(sound):
    table, there = sound.table("transforms"), np.array([20.0, 0.0, 0.0])
    carried, rows = on_edge(sound, "odom", "base_link"), on_edge(sound, "map", "odom")
    still = np.repeat(turned(carried[:1], table) + there, len(carried), axis=0)
    base = still[0]
    poses = np.zeros((len(rows), 3))
    poses[len(rows) // 2 :] = se2.compose(se2.compose(base, [0.0, 0.0, 0.1]), se2.inverse(base))
    far = with_poses(with_poses(sound, carried, still), rows, poses)
    told = LogAudit(far.view()).corrections

    assert told.at_origin.max() > 1.9
    assert told.at_robot.metres.max() < 1e-6
    assert said(far, "SR-TF-005") == []


# --- frames that hang nowhere -----------------------------------------------------------------


def renamed(bundle, name, column, frame):
    rows = np.arange(len(bundle.table(name)))
    return edited(bundle, name, rows, **{column: lambda old: np.full(len(old), frame, object)})


@pytest.mark.parametrize(
    ("name", "column", "severity", "words"),
    [
        ("scans", "frame_id", "warning", "lidar_2 of /scan (never on tf); they are taken to sit"),
        ("poses", "frame_id", "info", "lidar_2 of /amcl_pose (never on tf)"),
        ("odometry", "child_frame_id", "info", "lidar_2 of /odom (never on tf)"),
    ],
)
def test_frames_without_a_place_on_the_robot(sound, name, column, severity, words):
    (found,) = said(renamed(sound, name, column, "lidar_2"), "SR-TF-006")

    assert found[1] == severity
    assert words in found[2]


def test_a_frame_of_another_tree_is_not_said_to_be_missing(sound):
    other = with_edge(sound, "arm", "lidar_2", [START_NS], [0, 0, 0], is_static=True)
    (found,) = said(renamed(other, "scans", "frame_id", "lidar_2"), "SR-TF-006")

    assert "lidar_2 of /scan;" in found[2]


def test_a_log_without_tf_is_told_once(sound):
    bare = without(sound, "transforms", np.arange(len(sound.table("transforms"))))
    (found,) = said(bare, "SR-TF-006")

    assert "there is no tf in the log: laser of /scan" in found[2]


def test_a_robot_that_stands_is_no_fault(sound):
    table = sound.table("transforms")
    rows = on_edge(sound, "odom", "base_link")
    still = np.repeat(turned(rows[:1], table), len(rows), axis=0)
    quiet = with_poses(sound, rows, still)
    rows = on_edge(quiet, "map", "odom")
    quiet = with_poses(quiet, rows, np.repeat(turned(rows[:1], table), len(rows), axis=0))

    assert findings(quiet, "tf_tree", "tf_times", "tf_steps") == []


def test_stamps_of_tf_out_of_order_are_handled(sound):
    rows = on_edge(sound, "odom", "base_link")
    odd = restamped(sound, "transforms", rows[100:104], lambda t: t - SECOND)

    assert findings(odd, "tf_tree", "tf_times") == []
