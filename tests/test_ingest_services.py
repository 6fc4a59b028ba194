"""Calls of services, whose events recorders describe by the service's own text."""

import numpy as np
import pytest
from payloads import Container

from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.readers.open_log import open_log
from slamreplay.ingest.readers.reader import Connection
from slamreplay.ingest.reading import read_rows
from slamreplay.ingest.types import layouts
from slamreplay.ingest.wire.read import read_messages
from slamreplay.messages.interfaces import message_definition

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
EVENT, ODOM = "nav2_msgs/srv/SetInitialPose_Event", "nav_msgs/msg/Odometry"
MESSAGE = "nav2_msgs/msg/SetInitialPose_Event"
TOPIC = "/set_initial_pose/_service_event"
RULE = "=" * 80
POSE = "geometry_msgs/PoseWithCovarianceStamped pose\n---\n"
#: What a recorder stores beside it.
WHOLE = f"""{POSE}{RULE}
MSG: geometry_msgs/PoseWithCovarianceStamped
std_msgs/Header header
PoseWithCovariance pose
{RULE}
MSG: geometry_msgs/PoseWithCovariance
Pose pose
float64[36] covariance
{RULE}
MSG: geometry_msgs/Pose
Point position
Quaternion orientation
{RULE}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{RULE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


def event(logs, kind, x=None, second=3):
    request = []
    if x is not None:
        request = [
            logs.make("nav2_msgs/msg/SetInitialPose_Request", pose__header__frame_id="/map",
                      pose__pose__pose__position__x=x, pose__pose__pose__orientation__w=1.0)
        ]  # fmt: skip
    return logs.make(MESSAGE, info__event_type=kind, info__stamp__sec=second, request=request)


class Described(Container):
    """The container, with a definition as the recorder stores it."""

    def __init__(self, payloads, definition):
        super().__init__(TOPIC, EVENT, payloads, "cdr")
        (c,) = self.connections
        self.connections = (
            Connection(c.index, c.topic, c.type, c.encoding, definition, "msg", c.count),
        )


def read(logs, events, definition=""):
    payloads = [bytes(logs.stores[2].serialize_cdr(e, MESSAGE)) for e in events]
    (rows,), losses = read_rows([Described(payloads, definition)], lambda _: None, None)
    return rows, {(x.kind, x.reason): x.count for x in losses}


@pytest.mark.parametrize("definition", ["", POSE, WHOLE], ids=["none", "short", "whole"])
def test_poses_set_by_a_call_are_initial_poses(logs, definition):
    events = [event(logs, 0, 1.5), event(logs, 3), event(logs, 0, 2.5, second=9), event(logs, 3)]

    rows, told = read(logs, events, definition)

    assert (rows.table, rows.frame()) == ("initial_poses", "map")
    assert rows.columns["position_xyz"][:, 0].tolist() == [1.5, 2.5]
    assert (rows.t_sensor_ns // SECOND).tolist() == [3, 9]
    assert told == {("skipped", "answers, or requests without their content"): 2}


def test_a_call_that_both_ends_tell_counts_once(logs):
    rows, told = read(logs, [event(logs, 0, 1.5), event(logs, 1, 1.5), event(logs, 1, 7.0)])

    assert rows.columns["position_xyz"][:, 0].tolist() == [1.5, 7.0]
    assert told == {("skipped", "requests that their receiver told too"): 1}


def test_other_definitions_stay_as_they_are():
    assert message_definition("a/msg/T", "int8 x\n---\n") == "int8 x\n---\n"
    assert message_definition("a/srv/T_Event", "int8 x # --- no\n") == "int8 x # --- no\n"


def test_the_call_plays_the_initial_pose_where_no_topic_does(logs, tmp_path, monkeypatch):
    odometry = logs.make(ODOM, header__frame_id="odom", header__stamp__sec=EPOCH // SECOND,
                         pose__pose__orientation__w=1.0)  # fmt: skip
    call = event(logs, 1, 1.5, second=EPOCH // SECOND)
    path = logs.write("log.db3", [("/odom", ODOM, odometry, EPOCH), (TOPIC, MESSAGE, call, EPOCH)])
    import sqlite3

    with sqlite3.connect(path) as database:  # rosbags cannot write types of services
        database.execute("UPDATE topics SET type = ? WHERE type = ?", [EVENT, MESSAGE])
        database.execute("DELETE FROM message_definitions WHERE topic_type = ?", [MESSAGE])
    database.close()

    bundle = ingest([path], tmp_path / "b")

    assert {r.role: r.topic for r in bundle.manifest.roles}["initial_pose"] == TOPIC
    assert bundle.view().role("initial_pose")["position_xyz"].tolist() == [[1.5, 0.0, 0.0]]


def test_real_events_are_read_to_their_last_byte(real_logs):
    folder = real_logs / "fixtures/rosbag2_resources/rosbag2_tests/resources/mcap"
    (path,) = folder.rglob("bag_with_topics_and_service_events.mcap")
    with open_log([path]) as (readers, _):
        (reader,) = readers
        events = {c.index: c for c in reader.connections if c.type.endswith("_Event")}
        found = []
        for block in reader.blocks(set(events)):
            for number, connection in events.items():
                own = np.flatnonzero(block.connection == number)
                if len(own):
                    places = (block.start[own], block.end[own], block.t_log_ns[own])
                    of = (connection.topic, layouts(connection), "cdr")
                    found += [m for m, _ in read_messages(block.data, *places, *of)]

    assert sum(len(m) for m in found) == 8
    for messages in found:
        assert messages.column("info.event_type", int).tolist() == [0, 3, 0, 3]
        (_, asked), (_, answered) = messages.children("request"), messages.children("response")
        assert (asked.tolist(), answered.tolist()) == ([0, 2], [1, 3])
        assert np.ptp(messages.column("info.stamp.sec", int)) <= 1
