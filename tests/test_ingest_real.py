"""Roles, frames and clocks on logs of real robots, and readers against rosbags' own."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.errors import LogError
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.readers.open_log import open_log

TB4 = "olin_tb4/macfirst_floor_take_2"
JARVIS = "inesctec_jarvis/jarvis_circular_path_fast.bag"

#: Log: (map, odom, base), roles that must be played by these topics.
EXPECTED = {
    "zaki_kidnap/dec13/target_before.bag": (
        ("map", "odom", "base_link"),
        {"odometry": "/odom", "scan": "/scan", "pose": "/tf", "command": "/cmd_vel"},
    ),
    JARVIS: (
        ("map_contours_nav", "odom", "base_footprint"),
        {
            "scan": "/driver_laser_navigation/laser_scan", "pose": "/tf",
            "scan_2": "/driver_laser_security/laser_scan",
            "reference": "/pose_ground_truth", "command": "/cmd_vel",
            "points": "/driver_laser_navigation/beacons_scan",
        },
    ),
    "inesctec_jarvis/guardian_3.bag": (
        (None, "odom", "base_footprint"),
        {
            "odometry": "/guardian_node/odom", "scan": "/scan", "scan_2": "/hokuyo_back_scan",
            "command": "/guardian_node/command", "joints": "/joint_states",
        },
    ),
    "olin_neato/ac109_3_demo.bag": (
        ("map", "odom", "base_link"),
        {
            "odometry": "/odom", "scan": "/scan", "pose": "/tf", "map": "/map",
            "particles": "/particlecloud", "initial_pose": "/initialpose", "command": "/cmd_vel",
            "points": "/projected_stable_scan", "clock": "/clock",
        },
    ),
    TB4: (
        (None, "odom", "base_link"),
        {"odometry": "/odom", "scan": "/scan", "command": "/cmd_vel"},
    ),
    "evo_nav2/nav2_turtlebot.mcap": (
        ("map", "odom", "base_link"),
        {"odometry": "/odom", "pose": "/amcl_pose", "covariance": "/amcl_pose"},
    ),
    "birmingham/trace0.bag": (
        ("map", "odom", "base_link"),
        {"odometry": "/odom", "scan": "/base_scan", "pose": "/tf"},
    ),
    "stage_amcl/amcl_ground_truth_poses_and_estimated_poses.bag": (
        ("map", None, None),
        {
            "pose": "/amcl_pose", "covariance": "/amcl_pose",
            "reference": "/base_pose_ground_truth", "clock": "/clock",
        },
    ),
    "jackal/test_2026-02-17-15-54-31.bag": (
        (None, None, None),
        {"scan": "/scan", "reference": "/vrpn_client_node/jackal/pose"},
    ),
    "fixtures/turtlebot3_no_tf.bag": (
        (None, "odom", "base_footprint"),
        {
            "odometry": "/odom", "scan": "/scan", "imu": "/imu", "command": "/cmd_vel",
            "joints": "/joint_states",
        },
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EXPECTED)
def test_roles_and_frames(real_logs, tmp_path, name):
    bundle = ingest([real_logs / name], tmp_path / "b")

    frames, roles = EXPECTED[name]
    manifest = bundle.manifest
    assert (manifest.frames.map, manifest.frames.odom, manifest.frames.base) == frames
    assert {role.role: role.topic for role in manifest.roles} == roles
    assert manifest.clock.name == "sensor"
    belief = recorded_belief(bundle.view(), np.array([manifest.start_ns, manifest.end_ns]))
    assert (belief is None) == ("pose" not in roles)
    duration_s = (manifest.end_ns - manifest.start_ns) / 1e9
    assert 20.0 < duration_s < 110.0


def test_rosbag2_and_bag_of_one_run_give_the_same_scans(real_logs, tmp_path):
    stem = "test_2026-02-17-15-54-31"
    one = ingest([real_logs / f"jackal/{stem}.bag"], tmp_path / "one")
    two = ingest([real_logs / f"jackal/{stem}"], tmp_path / "two")

    for name in ("scans", "references"):
        a, b = one.table(name), two.table(name)
        np.testing.assert_array_equal(a["t_sensor_ns"], b["t_sensor_ns"])
    np.testing.assert_array_equal(
        one.table("scans")["ranges_m"].values, two.table("scans")["ranges_m"].values
    )


def test_log_times_of_another_epoch_do_not_tear_belief_from_odometry(real_logs, tmp_path):
    log = real_logs / "zaki_kidnap/dec13/target_before.bag"
    bundle = ingest([log], tmp_path / "b", IngestOptions(map=log.parent / "map/all.yaml"))
    view = bundle.view()
    scans = view.role("scan")

    odometry = odometry_track(view).at(scans.t_ns)
    belief = recorded_belief(view, scans.t_ns)

    assert odometry.has_pose.mean() > 0.95
    assert belief.has_pose.mean() > 0.95
    transforms = view.table("transforms")
    corrections = transforms.t_ns[transforms["child_frame"] == "odom"]
    assert bundle.manifest.start_ns - 10**10 < corrections.min()
    assert corrections.max() < bundle.manifest.end_ns + 10**10


@pytest.mark.parametrize("fit", ["tf", "turned"])
def test_laser_mount_on_tf_is_the_one_that_keeps_walls_sharp(real_logs, tmp_path, fit):
    from slamreplay.geometry import se2, se3

    bundle = ingest([real_logs / "olin_neato/ac109_3_demo.bag"], tmp_path / "b")
    view = bundle.view()
    scans = view.role("scan")
    poses = odometry_track(view).at(scans.t_ns).xyyaw
    T, valid = view.transforms.lookup(view.manifest.frames.base, "base_laser_link", scans.t_ns)
    assert valid.all()
    mount = se3.planar(T[0]) if fit == "tf" else se2.compose(se3.planar(T[0]), [0, 0, np.pi])
    cells = set()
    for row in np.flatnonzero(np.isfinite(poses).all(axis=1))[::3]:
        r = scans["ranges_m"][row]
        bearing = (
            scans["angle_min_rad"][row] + np.arange(len(r)) * scans["angle_increment_rad"][row]
        )
        hit = (r > scans["range_min_m"][row]) & (r < scans["range_max_m"][row])
        xy = np.column_stack([r * np.cos(bearing), r * np.sin(bearing)])[hit]
        points = se2.transform_points(se2.compose(poses[row], mount), xy)
        cells |= set(map(tuple, np.floor(points / 0.05).astype(int)))
    assert (len(cells) < 600) == (fit == "tf")


def test_maps_copied_from_another_computer_are_found(real_logs, tmp_path):
    maps = real_logs / "inesctec_jarvis/maps"
    bundle = ingest(
        [real_logs / JARVIS], tmp_path / "b", IngestOptions(map=maps / "i-108_10mm_dynamic.yaml")
    )

    assert bundle.grid().cells.shape == (1770, 2084)
    assert bundle.grid().frame_id == "map_contours_nav"
    reasons = [entry.reason for entry in bundle.manifest.losses if entry.kind == "repaired"]
    assert any("yaw of nan" in reason for reason in reasons)


def payloads(reader):
    """(topic, type, log time, bytes) of every message."""
    for block in reader.blocks(range(len(reader.connections))):
        columns = (block.connection, block.start, block.end, block.t_log_ns)
        for index, start, end, t_log_ns in zip(*(c.tolist() for c in columns), strict=True):
            connection = reader.connections[index]
            yield connection.topic, connection.type, t_log_ns, bytes(block.data[start:end])


FIXTURES = ["example.bag", "example-bz2.bag", "example-lz4.bag", "scan_only.db3", "tilt_laser.bag"]


@pytest.mark.parametrize("name", [f"fixtures/{n}" for n in FIXTURES] + [TB4])
def test_readers_give_the_messages_that_rosbags_gives(real_logs, name):
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    def count(messages):
        return Counter(messages)

    path = real_logs / name
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        theirs = count((c.topic, c.msgtype, t, bytes(d)) for c, t, d in reader.messages())
    with open_log([path]) as (readers, _):
        (ours,) = readers
        own = count(payloads(ours))
        counts = sum(c.count for c in ours.connections)

    assert own == theirs
    assert counts == sum(theirs.values())


def rosbag2_folders(root: Path):
    return sorted(p.parent for p in root.rglob("metadata.yaml"))


def test_every_rosbag2_of_the_fixtures_is_read_or_refused_in_one_line(real_logs, tmp_path):
    folders = rosbag2_folders(real_logs / "fixtures" / "rosbag2_resources")
    assert folders
    for folder in folders:
        with pytest.raises(LogError, match="no scan and no odometry") as caught:
            ingest([folder], tmp_path / "b")
        assert "\n" not in str(caught.value)


def test_old_bag_version_is_named(real_logs, tmp_path):
    with pytest.raises(LogError, match=r"ROSRECORD V1\.2"):
        ingest([real_logs / "fixtures/rosrecord_v12.bag"], tmp_path / "b")


def test_split_folder_gives_all_its_messages(real_logs):
    folder = real_logs / "fixtures/rosbag2_resources/rosbag2_py/test/resources/mcap/wbag"
    with open_log([folder]) as (readers, losses):
        assert len(readers) == 5
        assert sum(c.count for r in readers for c in r.connections) == 6074
    assert losses == []
