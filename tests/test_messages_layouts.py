"""Layouts of one name: the first that reads a message to its end is the one it was written in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from type_store import register_layout

from slamreplay.ingest.readers.open_log import open_log
from slamreplay.ingest.readers.reader import Connection
from slamreplay.ingest.types import layouts as layouts_of
from slamreplay.ingest.wire.read import read_messages
from slamreplay.messages.definitions import DEFINITIONS, LATER_DEFINITIONS
from slamreplay.messages.interfaces import SEPARATOR, as_message, message_definition
from slamreplay.messages.layouts import layouts
from slamreplay.messages.recoveries import INTERFACES

TREE = "nav2_msgs/msg/BehaviorTreeLog"
TO_POSE = "nav2_msgs/action/NavigateToPose_FeedbackMessage"
THROUGH = "nav2_msgs/action/NavigateThroughPoses_FeedbackMessage"
CLEAR = "nav2_msgs/srv/ClearEntireCostmap_Event"
AMBIGUOUS = {
    TREE: ("event_log", "nav2_msgs/msg/BehaviorTreeStatusChange"),
    CLEAR: ("request", "nav2_msgs/msg/ClearEntireCostmap_Request"),
    "nav2_msgs/srv/ClearCostmapAroundRobot_Event": (
        "request",
        "nav2_msgs/msg/ClearCostmapAroundRobot_Request",
    ),
    "nav2_msgs/srv/ClearCostmapExceptRegion_Event": (
        "request",
        "nav2_msgs/msg/ClearCostmapExceptRegion_Request",
    ),
    "nav2_msgs/srv/ClearCostmapAroundPose_Event": (
        "request",
        "nav2_msgs/msg/ClearCostmapAroundPose_Request",
    ),
    "fiducial_msgs/msg/FiducialTransformArray": (
        "transforms",
        "fiducial_msgs/msg/FiducialTransform",
    ),
    TO_POSE: None,
    THROUGH: None,
    "nav2_msgs/msg/CollisionMonitorState": None,
}


def store_of(name, text):
    store = get_typestore(Stores.ROS2_HUMBLE)
    register_layout(store, name, text)
    for other, fields in DEFINITIONS.items():
        if other not in store.fielddefs:
            store.register(get_types_from_msg(fields, other))
    return store


def payload(logs, store, name, **values):
    """A message with one element in the sequence that differs between layouts."""
    logs.stores[2] = store
    message = logs.make(as_message(name))
    sequence = AMBIGUOUS[name]
    if sequence is not None:
        getattr(message, sequence[0]).append(logs.make(sequence[1], **values))
    return bytes(store.serialize_cdr(message, as_message(name)))


@pytest.mark.parametrize("name", AMBIGUOUS)
def test_the_first_layout_that_reads_all_of_a_message_is_its_own(logs, name):
    stores = [store_of(name, text) for text in layouts(name)]
    assert len(stores) > 1

    for number, store in enumerate(stores):
        values = {"node_name": "BackUp", "current_status": "RUNNING"} if name == TREE else {}
        data = payload(logs, store, name, **values)
        readable = []
        for k, other in enumerate(stores):
            try:
                other.deserialize_cdr(data, as_message(name))
                readable.append(k)
            except (SerdeError, ValueError, IndexError, UnicodeDecodeError):
                pass
        assert readable[0] == number


def test_a_tree_log_that_both_layouts_can_read_says_the_same_in_both(logs):
    # Where two bytes of padding follow the node's name, `uid` fits into them.
    newest, oldest = (store_of(TREE, text) for text in layouts(TREE))
    data = payload(logs, oldest, TREE, node_name="Spin", current_status="RUNNING")

    (one,), (other,) = (s.deserialize_cdr(data, TREE).event_log for s in (newest, oldest))

    assert (one.node_name, one.current_status) == (other.node_name, other.current_status)


def test_layouts_come_newest_first_and_whole():
    newest, oldest = layouts(TREE)

    assert "uint16 uid\n" in newest
    assert "uid" not in oldest
    for text in (newest, oldest):
        assert f"{SEPARATOR}MSG: nav2_msgs/msg/BehaviorTreeStatusChange\n" in text
    tracking, humble, foxy = layouts(TO_POSE)
    assert "heading_tracking_error" in tracking
    assert "estimated_time_remaining" in humble
    assert "estimated_time_remaining" not in foxy
    assert [("waypoint_statuses" in t, "tracking_error" in t) for t in layouts(THROUGH)] == [
        (True, True), (True, False), (False, False),
    ]  # fmt: skip
    assert layouts("nobody_msgs/msg/Unknown") == []


@pytest.mark.parametrize("name", INTERFACES)
def test_every_layout_of_an_action_or_service_is_whole(name):
    parts = ["Event"] if "/srv/" in name else ["FeedbackMessage", "SendGoal_Event"]
    for part in parts:
        for text in layouts(f"{name}_{part}"):
            store = store_of(f"{name}_{part}", text)
            assert store.types[as_message(f"{name}_{part}")]


@pytest.mark.parametrize("head", ["", f"{SEPARATOR}SRV: nav2_msgs/srv/ClearEntireCostmap\n"])
def test_the_text_of_a_service_becomes_its_event(head):
    text = (
        f"{head}# Clears\n\nstd_msgs/Empty request\nstring[] plugins  # to clear\n---\nbool success"
    )

    found = message_definition(CLEAR, text)

    assert layouts(CLEAR)[0].startswith(found)
    assert message_definition(CLEAR, found) == found


def test_the_text_of_an_action_becomes_its_feedback_and_its_calls():
    text = (
        "# goal\nnav_msgs/Goals poses\n---\nuint16 NONE=0\n---\n"
        f"int16 count 3\nWaypointStatus[] waypoints\n{SEPARATOR}MSG: nav2_msgs/WaypointStatus\n"
        "uint8 waypoint_status\n"
    )
    name = "nav2_msgs/action/Tour"

    kind = as_message(name)
    feedback, sent = (
        get_types_from_msg(message_definition(f"{name}_{part}", text), f"{kind}_{part}")
        for part in ("FeedbackMessage", "SendGoal_Event")
    )
    result = message_definition(f"{name}_GetResult_Event", text)

    assert [f[0] for f in feedback[f"{kind}_FeedbackMessage"][1]] == ["goal_id", "feedback"]
    assert feedback[f"{kind}_Feedback"][1][1][1][1][0][1] == "nav2_msgs/msg/WaypointStatus"
    assert [f[0] for f in sent[f"{kind}_SendGoal_Request"][1]] == ["goal_id", "goal"]
    assert [f[0] for f in sent[f"{kind}_SendGoal_Event"][1]] == ["info", "request", "response"]
    assert "structure_needs_at_least_one_member" in result  # a result of constants alone


@given(st.sampled_from(sorted({**DEFINITIONS, **LATER_DEFINITIONS})), st.text(max_size=40))
def test_definitions_of_plain_messages_stay_as_they_are(name, text):
    assert message_definition(name, DEFINITIONS[name]) == DEFINITIONS[name]
    assert message_definition(name, text) == text


def test_the_text_of_an_action_is_no_definition_of_its_status():
    text = f"{SEPARATOR}ACTION: nav2_msgs/action/Spin\nfloat32 target_yaw\n---\n---\n"

    assert message_definition("action_msgs/msg/GoalStatusArray", text) == ""


def test_service_events_of_a_real_recorder_are_read(real_logs):
    folder = real_logs / "fixtures/rosbag2_resources/rosbag2_tests/resources/mcap"
    path = folder / "bag_with_topics_and_service_events/bag_with_topics_and_service_events.mcap"
    kinds, asked = [], 0
    with open_log([path]) as ((reader,), _):
        events = {c.index: c for c in reader.connections if c.type.endswith("_Event")}
        for block in reader.blocks(set(events)):
            for index, connection in events.items():
                own = block.connection == index
                for messages, _ in read_messages(
                    block.data, block.start[own], block.end[own], block.t_log_ns[own],
                    connection.topic, layouts_of(connection), connection.encoding,
                ):  # fmt: skip
                    kinds += messages.column("info.event_type", np.int64).tolist()
                    asked += len(messages.children("request")[1])

    assert sorted(kinds) == [0, 0, 0, 0, 3, 3, 3, 3]
    assert asked == 4


def test_a_type_without_fields_is_a_byte_of_cdr_and_none_of_ros1():
    text = f"a_msgs/Nothing nothing\nuint8 last\n{SEPARATOR}MSG: a_msgs/Nothing\n"

    for encoding, payload in (("ros1", b"\x07"), ("cdr", b"\x00\x01\x00\x00\x00\x07")):
        connection = Connection(0, "/t", "a_msgs/msg/A", encoding, text, "msg", 1)
        data = np.frombuffer(payload, dtype=np.uint8)
        start, end = np.array([0]), np.array([len(payload)])
        ((messages, _),) = read_messages(
            data, start, end, start, "/t", layouts_of(connection), encoding
        )
        assert messages.column("last").tolist() == [7]
