"""Tags and landmarks of all detectors: the tag in the frame it was seen in, or a count."""

import numpy as np
import pytest
from payloads import read_back

from slamreplay.bundle.sightings import _stated, _with_usual
from slamreplay.ingest import DECODERS
from slamreplay.ingest.decoders.decoder import Messages
from slamreplay.messages.definitions import LATER_DEFINITIONS
from slamreplay.messages.tags import TAGS

SECOND = 10**9
ZEROS = "its position is all zeros: no pose was found"
TURNLESS = "quaternion is zero or not finite"
ISAAC = "isaac_ros_apriltag_interfaces/msg/AprilTagDetection"
ARUCO, ALVAR = "aruco_msgs/msg/Marker", "ar_track_alvar_msgs/msg/AlvarMarker"
LANDMARK = "cartographer_ros_msgs/msg/LandmarkEntry"
#: Detections of one message: a good one, one of zeros, one without a turn, a wild one.
PLACES = [(1.0, 1.0), (0.0, 1.0), (2.0, 0.0), (float("nan"), 1.0)]
TOLD = {
    ("skipped", ZEROS): 1, ("lost", TURNLESS): 1, ("lost", "position is not finite"): 1,
}  # fmt: skip


def tags(logs, kind, ros, path, **values):
    """One detection for each of PLACES, with ids from 5 on."""
    return [
        logs.make(kind, ros, id=5 + k, **{f"{path}__position__x": x, f"{path}__orientation__w": w},
                  **values)
        for k, (x, w) in enumerate(PLACES)
    ]  # fmt: skip


def lists(logs, ros):
    return [
        logs.make("geometry_msgs/msg/Pose", ros, position__x=x, orientation__w=w) for x, w in PLACES
    ]


HEADER = {"header__frame_id": "/camera", "header__stamp__sec": 3}
CASES = {
    f"{ISAAC}Array": lambda logs, ros: logs.make(
        f"{ISAAC}Array", ros, detections=tags(logs, ISAAC, ros, "pose__pose__pose"), **HEADER
    ),
    f"{ARUCO}Array": lambda logs, ros: logs.make(
        f"{ARUCO}Array", ros, markers=tags(logs, ARUCO, ros, "pose__pose", confidence=1.0), **HEADER
    ),
    f"{ALVAR}s": lambda logs, ros: logs.make(
        f"{ALVAR}s", ros, markers=tags(logs, ALVAR, ros, "pose__pose", **HEADER)
    ),
    "ros2_aruco_interfaces/msg/ArucoMarkers": lambda logs, ros: logs.make(
        "ros2_aruco_interfaces/msg/ArucoMarkers", ros, marker_ids=np.arange(5, 9),
        poses=lists(logs, ros), **HEADER,
    ),
    "aruco_interfaces/msg/ArucoMarkers": lambda logs, ros: logs.make(
        "aruco_interfaces/msg/ArucoMarkers", ros, marker_ids=np.arange(5, 9),
        poses=lists(logs, ros), **HEADER,
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", CASES)
def test_a_detector_gives_its_good_tags_and_a_count_of_the_others(logs, kind):
    def make(ros):
        return [CASES[kind](logs, ros)] * 2

    rows, told = read_back(logs, kind, make)

    assert rows.table == "references"
    assert rows.columns["child_frame_id"].tolist() == ["tag_5", "tag_5"]
    assert rows.columns["position_xyz"][0].tolist() == [1.0, 0.0, 0.0]
    assert set(rows.columns["frame_id"]) == {"camera"}
    assert set(rows.columns["kind"]) == {"fiducial"}
    assert rows.t_sensor_ns.tolist() == [3 * SECOND] * 2
    assert told == {reason: 2 * count for reason, count in TOLD.items()}


def test_a_single_marker_is_a_message_of_its_own(logs):
    def make(ros):
        values = {"pose__pose__position__x": 1.0, "pose__pose__orientation__w": 1.0}
        return [logs.make(ARUCO, ros, id=9, confidence=c, **values, **HEADER) for c in (1.0, 0.0)]

    rows, told = read_back(logs, ARUCO, make)

    assert rows.columns["child_frame_id"].tolist() == ["tag_9"]
    assert told == {("skipped", "of no confidence, says the detector"): 1}


def test_newer_markers_with_corners_are_read_by_their_own_definition(logs):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    text = ("std_msgs/Header header\nuint32 id\ngeometry_msgs/Point[] corners\n"
            "geometry_msgs/Point center\ngeometry_msgs/PoseWithCovariance pose\n"
            "float64 confidence\n")  # fmt: skip
    store.register(get_types_from_msg(text, ARUCO))
    logs.stores[2] = store
    marker = logs.make(ARUCO, id=4, confidence=1.0, pose__pose__position__x=1.0,
                       pose__pose__orientation__w=1.0)  # fmt: skip
    path = logs.write("m.mcap", [("/marker", ARUCO, marker, 1)])

    from slamreplay.ingest.readers.open_log import open_log
    from slamreplay.ingest.reading import read_rows

    with open_log([path]) as (readers, _):
        (rows,), losses = read_rows(readers, lambda _topic: None, None)

    assert (rows.columns["child_frame_id"].tolist(), losses) == (["tag_4"], [])


def test_ids_and_poses_that_do_not_pair_are_counted(logs):
    kind = "ros2_aruco_interfaces/msg/ArucoMarkers"

    def make(ros):
        pose = logs.make("geometry_msgs/msg/Pose", ros, position__z=1.0, orientation__w=1.0)
        return [
            logs.make(kind, ros, marker_ids=np.array(ids, dtype=np.int64), poses=[pose] * poses)
            for ids, poses in (([1, 2, 3], 1), ([4], 2), ([], 0), ([5], 1))
        ]

    rows, told = read_back(logs, kind, make)

    assert rows.columns["child_frame_id"].tolist() == ["tag_1", "tag_4", "tag_5"]
    assert told == {("skipped", "an id without a pose"): 2, ("skipped", "a pose without an id"): 1}


def test_landmarks_without_an_orientation_may_point_anywhere(logs):
    kind = "cartographer_ros_msgs/msg/LandmarkList"
    weights = (("7", 1.0, 1.0), ("reflector", 1.0, 0.0), ("9", 0.0, 0.0))

    def make(ros):
        path = "tracking_from_landmark_transform"
        entries = [
            logs.make(LANDMARK, ros, id=name, translation_weight=place, rotation_weight=turn,
                      **{f"{path}__position__y": 2.0, f"{path}__orientation__w": 1.0})
            for name, place, turn in weights
        ]  # fmt: skip
        return [logs.make(kind, ros, landmark=entries, **HEADER)]

    rows, told = read_back(logs, kind, make)

    assert rows.columns["child_frame_id"].tolist() == ["tag_7", "reflector"]
    covariance = rows.columns["covariance"].reshape(-1, 6, 6)
    assert np.isnan(covariance[0]).all()
    assert np.isnan(covariance[1, :3, :3]).all()
    np.testing.assert_allclose(np.diag(covariance[1, 3:, 3:]), np.pi**2 / 3)
    assert told == {("skipped", "of no weight, says the detector"): 1}
    stated = _stated(rows.columns["covariance"], np.tile(np.eye(3), (2, 1, 1)))
    usual, wide = _with_usual(stated, rows.columns["position_xyz"][:, :2])
    np.testing.assert_array_equal(usual[:2, :2], wide[:2, :2])
    np.testing.assert_allclose(wide[2, 2] - usual[2, 2], np.pi**2 / 3)


def test_fiducials_that_were_not_detected_are_counted(logs):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    kind = "fiducial_msgs/msg/FiducialTransform"
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(LATER_DEFINITIONS[kind], kind))
    array = "std_msgs/Header header\nint32 image_seq\nfiducial_msgs/FiducialTransform[] transforms"
    store.register(get_types_from_msg(array, f"{kind}Array"))
    logs.stores[2] = store
    seen = [
        logs.make(kind, fiducial_id=k, transform__translation__z=1.0, transform__rotation__w=1.0,
                  detected=k != 3)
        for k in (2, 3)
    ]  # fmt: skip
    whole = logs.make(f"{kind}Array", transforms=seen)

    decoded = DECODERS.load(f"{kind}Array").decode(Messages([whole], np.array([1])))

    assert decoded.columns["child_frame_id"].tolist() == ["tag_2"]
    told = {r.reason: r.count for r in decoded.remarks if r.count}
    assert told == {"not detected, says the detector": 1}


def test_every_tag_type_has_its_definition():
    assert {*CASES, ARUCO, "cartographer_ros_msgs/msg/LandmarkList"} <= set(TAGS)
