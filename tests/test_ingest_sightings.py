"""What the robot sensed of tags and docks is a measurement; a satellite fix is one in metres."""

import numpy as np
import pytest

from slamreplay.bundle.sightings import _stated, _with_usual
from slamreplay.geometry.geodesy import earth_from_geodetic
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.sightings import is_tag_frame

TF, POSE = "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/PoseStamped"
FIX, ODOM = "sensor_msgs/msg/NavSatFix", "nav_msgs/msg/Odometry"
SECOND = 10**9


def stamped(logs, kind, step, **values):
    stamp = {"header__stamp__sec": 1_700_000_000, "header__stamp__nanosec": step * 10**8}
    return logs.make(kind, **stamp, **values)


def edge(logs, step, parent, child, x=0.0):
    return stamped(
        logs, "geometry_msgs/msg/TransformStamped", step, header__frame_id=parent,
        child_frame_id=child, transform__translation__x=x, transform__rotation__w=1.0,
    )  # fmt: skip


@pytest.fixture
def bundle(logs, tmp_path):
    """Odometry, tags on tf, a fixed tag, docks, GNSS."""
    messages = []
    for step in range(9):
        t = (1_700_000_000 * SECOND) + step * 10**8
        seen = [edge(logs, step, "odom", "base_link", 0.1 * step),
                edge(logs, step, "camera", f"tag_{step % 2}", 1.0 + 0.01 * step),
                edge(logs, step, "map", "tag_9", 5.0)]  # fmt: skip
        odometry = {"header__frame_id": "odom", "child_frame_id": "base_link",
                    "pose__pose__orientation__w": 1.0}  # fmt: skip
        pose = {"header__frame_id": "camera", "pose__orientation__w": 1.0}
        messages += [
            ("/tf", TF, logs.make(TF, transforms=seen), t),
            ("/odom", ODOM, stamped(logs, ODOM, step, **odometry), t),
            ("/odometry/gps", ODOM, stamped(logs, ODOM, step, **odometry), t),
            ("/detected_dock_pose", POSE, stamped(logs, POSE, step, **pose), t),
            ("/staging_pose", POSE, stamped(logs, POSE, step, **pose), t),
            ("/r1/dock_pose", POSE, stamped(logs, POSE, step, **pose), t),
            ("/filtered_dock_pose", POSE, stamped(logs, POSE, step, **pose), t),
            ("/fix", FIX, stamped(logs, FIX, step), t),
        ]
    return ingest([logs.write("log.mcap", messages)], tmp_path / "b")


def test_tags_on_tf_are_sightings_and_stay_on_tf(bundle):
    rows = bundle.view().table("references")
    rows = rows.take(rows["kind"] == "fiducial")

    assert sorted(rows["child_frame_id"]) == ["tag_0"] * 5 + ["tag_1"] * 4
    assert set(rows["frame_id"]) == {"camera"}
    np.testing.assert_allclose(np.sort(rows["position_xyz"][:, 0]), 1.0 + 0.01 * np.arange(9))
    assert "tag_0" in set(bundle.table("transforms")["child_frame"])


def test_sensed_docks_are_measurements_and_staging_poses_are_not(bundle):
    rows = bundle.view().table("references")
    rows = rows.take(rows["kind"] == "dock")

    assert set(rows["topic"]) == {"/detected_dock_pose"}
    assert set(rows["child_frame_id"]) == {"dock"}
    reasons = {x.what: (x.count, x.reason.partition(":")[0]) for x in bundle.manifest.losses}
    assert reasons["/staging_pose"] == (9, "where docking begins")
    assert reasons["/r1/dock_pose"] == (9, "where docking takes the dock to be")
    assert reasons["/filtered_dock_pose"] == (9, "detections of the dock, smoothed")


def test_gnss_is_neither_odometry_nor_belief_and_a_fix_is_a_measurement(bundle):
    roles = {r.role: r.topic for r in bundle.manifest.roles}
    assert roles["odometry"] == "/odom"
    assert "/odometry/gps" not in roles.values()
    rows = bundle.view().table("references")
    rows = rows.take(rows["kind"] == "gnss")
    assert (len(rows), set(rows["frame_id"]), set(rows["child_frame_id"])) == (9, {"earth"}, {""})
    np.testing.assert_allclose(rows["position_xyz"][0], [6_378_137.0, 0.0, 0.0])


def test_fixes_are_metres_and_their_covariance_is_turned_with_them(logs, tmp_path):
    values = {"latitude": 60.0, "longitude": 90.0, "altitude": 100.0, "position_covariance_type": 2,
              "position_covariance": np.diag([1.0, 4.0, 9.0]).ravel()}  # fmt: skip
    bad = {"latitude": np.nan}
    none = {"status__status": -1}
    rows = [stamped(logs, FIX, k, **v) for k, v in enumerate((values, bad, none, values))]
    odometry = stamped(logs, ODOM, 0, header__frame_id="odom", pose__pose__orientation__w=1.0)
    messages = [("/odom", ODOM, odometry, 10**18)]
    messages += [("/fix", FIX, m, 10**18 + k) for k, m in enumerate(rows)]
    log = logs.write("f.mcap", messages)
    bundle = ingest([log], tmp_path / "b")
    found = bundle.view().table("references")

    assert len(found) == 2
    np.testing.assert_allclose(found["position_xyz"][0], earth_from_geodetic([60, 90, 100]))
    cov = found["covariance"][0].reshape(6, 6)[:3, :3]
    np.testing.assert_allclose(cov[0, 0], 1.0)  # at 90 degrees east, east is -x
    np.testing.assert_allclose(np.linalg.eigvalsh(cov), [1.0, 4.0, 9.0])
    reasons = {x.reason for x in bundle.manifest.losses if x.what == "/fix"}
    assert reasons == {"latitude or longitude is none", "the receiver had no fix"}


def test_fixes_without_bounds_are_counted_and_covariances_without_bounds_not_known(logs, tmp_path):
    wide = {"position_covariance": np.full(9, np.inf), "position_covariance_type": 2}
    values = ({"latitude": np.inf}, {"longitude": -np.inf}, wide)
    odometry = stamped(logs, ODOM, 0, header__frame_id="odom", pose__pose__orientation__w=1.0)
    messages = [("/odom", ODOM, odometry, 10**18)]
    messages += [
        ("/fix", FIX, stamped(logs, FIX, k, **v), 10**18 + k) for k, v in enumerate(values)
    ]
    bundle = ingest([logs.write("f.mcap", messages)], tmp_path / "b")
    found = bundle.view().table("references")

    assert len(found) == 1
    assert np.isnan(found["covariance"][0].reshape(6, 6)[:3, :3]).all()
    assert [x.count for x in bundle.manifest.losses if x.what == "/fix"] == [2]


def test_types_that_tell_nothing_here_are_counted_with_a_reason(logs, tmp_path):
    kinds = ("apriltag_msgs/msg/AprilTagDetectionArray", "fiducial_msgs/msg/FiducialArray",
             "nav_msgs/msg/MapMetaData")  # fmt: skip
    odometry = stamped(logs, ODOM, 0, header__frame_id="odom", pose__pose__orientation__w=1.0)
    messages = [("/odom", ODOM, odometry, 10**18)]
    messages += [(f"/t{k}", kind, logs.make(kind), 10**18 + k) for k, kind in enumerate(kinds)]

    bundle = ingest([logs.write("log.db3", messages)], tmp_path / "b")

    losses = {x.what: (x.kind, x.count, x.reason) for x in bundle.manifest.losses}
    assert losses == {
        f"/t0 ({kinds[0]})": (
            "skipped", 1, "tags without a pose: apriltag_ros puts their poses on tf",
        ),
        f"/t1 ({kinds[1]})": ("skipped", 1, "corners of tags in an image, without a pose"),
        f"/t2 ({kinds[2]})": ("skipped", 1, "size and origin of a map, without its cells"),
    }  # fmt: skip


@pytest.mark.parametrize(("frame", "kept"), [("tag_7", "/markers"), ("36h11:7", "/tf")])
def test_a_tag_told_in_a_message_and_on_tf_was_seen_once(logs, tmp_path, frame, kept):
    markers, odom = "aruco_msgs/msg/MarkerArray", ("odom", "base_link")
    messages = []
    for step in range(4):
        t = (1_700_000_000 * SECOND) + step * 10**8
        place = {"pose__pose__position__x": 1.0 + step, "pose__pose__orientation__w": 1.0}
        marker = logs.make("aruco_msgs/msg/Marker", id=7, confidence=1.0, **place)
        seen = stamped(logs, markers, step, header__frame_id="camera", markers=[marker])
        edges = [edge(logs, step, *odom), edge(logs, step, "camera", frame, 1.0 + step)]
        messages += [
            ("/tf", TF, logs.make(TF, transforms=edges), t),
            ("/markers", markers, seen, t),
        ]

    bundle = ingest([logs.write("log.mcap", messages)], tmp_path / "b")

    rows = bundle.table("references")
    assert (rows["topic"].tolist(), set(rows["child_frame_id"])) == ([kept] * 4, {frame})
    (loss,) = [x for x in bundle.manifest.losses if x.kind == "skipped"]
    assert (loss.count, loss.reason) == (4, "tags told twice, in a message and on tf")


@pytest.mark.parametrize(
    ("frame", "is_tag"),
    [("tag_0", True), ("/tag36h11:12", True), ("36h11:0", True), ("41h12:3", True),
     ("4h:3", False), ("robot/fiducial_3", True), ("tag", False),
     ("stage_0", False), ("camera_tag_mount", False), ("laser_2", False)],
)  # fmt: skip
def test_names_of_tag_frames(frame, is_tag):
    assert is_tag_frame(frame) == is_tag


def test_a_sighting_without_bounds_has_the_usual_covariance():
    none, endless = np.full((1, 36), np.nan), np.diag([np.inf] * 6).reshape(1, 36)
    turn, xy = np.array([[[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]]), np.ones((1, 2))

    stated = [_stated(covariance, turn) for covariance in (none, endless)]

    np.testing.assert_array_equal(stated, np.nan)
    np.testing.assert_array_equal(_with_usual(stated[0], xy), _with_usual(stated[1], xy))
    assert np.isfinite(_with_usual(stated[0], xy)).all()
