"""Everything a log may say of recoveries and goals becomes rows, once each, of either ROS."""

import sqlite3
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore
from type_store import register_layout

from slamreplay.ingest import DECODERS
from slamreplay.ingest.action_names import action_of, is_recovery, service_of
from slamreplay.ingest.changes import settle_changes
from slamreplay.ingest.decoders.decoder import Messages
from slamreplay.ingest.log_lines import told_in_logs
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.readers.open_log import open_log
from slamreplay.ingest.reading import read_rows
from slamreplay.ingest.roles import choose_recovery
from slamreplay.ingest.rows import TopicRows
from slamreplay.messages.definitions import DEFINITIONS
from slamreplay.messages.interfaces import (
    SEPARATOR,
    as_message,
    base_interface,
    message_definition,
)
from slamreplay.messages.layouts import layouts
from slamreplay.messages.recoveries import INTERFACES

GOAL = "action_msgs/msg/GoalStatusArray"
GOAL_ROS1 = "actionlib_msgs/msg/GoalStatusArray"
SPIN = "nav2_msgs/action/Spin_FeedbackMessage"
TO_POSE = "nav2_msgs/action/NavigateToPose_FeedbackMessage"
CLEAR = "nav2_msgs/srv/ClearEntireCostmap_Event"
SEND = "nav2_msgs/action/Spin_SendGoal_Event"
START = 1_700_000_000_000_000_000


def uuid(number):
    return np.full(16, number, dtype=np.uint8)


def statuses(logs, *goals):
    """A GoalStatusArray of (goal number, status number)."""
    listed = [
        logs.make("action_msgs/msg/GoalStatus", status=status, goal_info__goal_id__uuid=uuid(goal))
        for goal, status in goals
    ]
    return logs.make(GOAL, status_list=listed)


def read(logs, name, *messages, ros=2):
    """Rows of a log of (topic, type, message), a second apart, and what was lost of it."""
    timed = [(*m, START + k * 10**9) for k, m in enumerate(messages)]
    return rows_of(logs.write(name, timed, ros))


def recorded(logs, messages):
    """A db3 as Humble's recorder writes it, without any definition."""
    path = logs.folder / "humble.db3"
    with sqlite3.connect(path) as db:
        db.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, "
                   "serialization_format TEXT, offered_qos_profiles TEXT)")  # fmt: skip
        db.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, "
                   "timestamp INTEGER, data BLOB)")  # fmt: skip
        topics = {}
        for topic, kind, message, t_ns in messages:
            if topic not in topics:
                topics[topic] = len(topics) + 1
                row = (topics[topic], topic, kind)
                db.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", row)
            data = bytes(logs.stores[2].serialize_cdr(message, as_message(kind)))
            db.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)",
                       (topics[topic], t_ns, data))  # fmt: skip
    return path


def rows_of(path):
    with open_log([path]) as (readers, _):
        return read_rows(readers, lambda _topic: None, None)


def told(rows):
    """(name, status) of each row."""
    return list(zip(rows.columns["name"], rows.columns["status"], strict=True))


def goals_of(rows):
    """(goal number, status) of each row."""
    goals, status = rows.columns["goal"], rows.columns["status"]
    return [(g[:2], s) for g, s in zip(goals, status, strict=True)]


def decode(kind, *items, topic=""):
    messages = Messages(items, np.arange(len(items)), topic)
    return DECODERS.load(kind).decode(messages)


def pairs(decoded):
    return list(zip(decoded.columns["name"], decoded.columns["status"], strict=True))


@pytest.mark.parametrize(
    ("topic", "action"),
    [
        ("/spin/_action/status", "spin"),
        ("/robot1/back_up/_action/feedback", "back_up"),
        ("/spin/_action/send_goal/_service_event", "spin"),
        ("/move_base/status", "move_base"),
        ("/r/move_base_flex/recovery/result", "recovery"),
        ("/scan", ""),
        ("/status", ""),
    ],
)
def test_the_action_stands_in_the_topics_name(topic, action):
    assert action_of(topic) == action


def test_names_of_recoveries():
    assert service_of("/local_costmap/clear_around_local_costmap/_service_event").startswith(
        "clear"
    )
    assert service_of("/odom") == ""
    assert all(map(is_recovery, ["spin", "backup", "back_up", "drive_on_heading", "wait_5s",
                                 "assisted_teleop", "ClearLocalCostmap-Context"]))  # fmt: skip
    assert not any(map(is_recovery, ["follow_path", "dock_robot", "waypoint", "compute_path"]))


def test_every_decoder_of_an_action_or_service_has_its_layouts():
    derived = [name for name in DECODERS if base_interface(name)]

    assert {base_interface(name) for name in derived} == set(INTERFACES)
    assert all(layouts(name) for name in derived)


# --- behaviour tree -------------------------------------------------------------------------


def test_a_node_done_within_one_tick_has_run_all_the_same(logs):
    change = "nav2_msgs/msg/BehaviorTreeStatusChange"
    events = [
        logs.make(change, node_name=name, previous_status=before, current_status=after)
        for name, before, after in (
            ("ClearLocalCostmap-Context", "IDLE", "SUCCESS"),
            ("Spin", "IDLE", "RUNNING"),
            ("Spin", "RUNNING", "FAILURE"),
        )
    ]
    log = logs.make("nav2_msgs/msg/BehaviorTreeLog", event_log=events)

    assert pairs(decode("nav2_msgs/msg/BehaviorTreeLog", log)) == [
        ("ClearLocalCostmap-Context", "running"),
        ("ClearLocalCostmap-Context", "success"),
        ("Spin", "running"),
        ("Spin", "failure"),
    ]


# --- actions of ROS 2 -----------------------------------------------------------------------


def test_a_goal_gives_a_row_for_each_change_of_its_status(logs):
    arrays = [statuses(logs, (1, s)) for s in (1, 2, 2, 2, 4, 4)]
    arrays.append(statuses(logs, (1, 4), (2, 2)))
    messages = [("/robot/spin/_action/status", GOAL, a) for a in arrays]

    (rows,), losses = read(logs, "a.mcap", *messages)

    assert told(rows) == [("spin", s) for s in ("accepted", "executing", "succeeded", "executing")]
    assert rows.columns["goal"].tolist() == [uuid(g).tobytes().hex() for g in (1, 1, 1, 2)]
    assert rows.t_log_ns.tolist() == [START + k * 10**9 for k in (0, 1, 4, 6)]
    assert losses == []


def test_a_goal_that_a_newer_one_replaces_did_not_fail(logs):
    arrays = [
        statuses(logs, (1, 2)),
        statuses(logs, (1, 6), (2, 1)),
        statuses(logs, (1, 6), (2, 2)),
        statuses(logs, (1, 6), (2, 6)),
    ]

    decoded = decode(GOAL, *arrays, topic="/navigate_to_pose/_action/status")

    assert goals_of(decoded) == [
        ("01", "executing"), ("01", "preempted"), ("02", "accepted"), ("02", "executing"),
        ("02", "aborted"),
    ]  # fmt: skip


def test_goals_of_other_actions_are_counted_and_left_out(logs):
    decoded = decode(GOAL, statuses(logs, (1, 2)), topic="/follow_path/_action/status")

    assert len(decoded.rows) == 0
    assert [(r.kind, r.count) for r in decoded.remarks] == [("skipped", 1)]


@given(st.lists(st.lists(st.tuples(st.integers(0, 3), st.integers(1, 6)), max_size=4), max_size=8))
def test_no_goal_has_the_same_status_twice_in_a_row_or_one_after_its_end(arrays):
    from types import SimpleNamespace as Message

    items = [
        Message(
            status_list=[
                Message(status=s, goal_info=Message(goal_id=Message(uuid=uuid(g))))
                for g, s in array
            ]
        )
        for array in arrays
    ]
    decoded = decode(GOAL, *items, topic="/spin/_action/status")
    final = {"succeeded", "canceled", "aborted", "preempted"}
    for goal in set(decoded.columns["goal"]):
        own = decoded.columns["status"][decoded.columns["goal"] == goal].tolist()
        assert all(a != b for a, b in pairwise(own))
        assert not final & set(own[:-1])
    assert {g[:2] for g in decoded.columns["goal"]} == {f"{g:02x}" for a in arrays for g, _ in a}


def test_feedback_of_a_behaviour_is_its_start(logs):
    items = [logs.make(as_message(SPIN), goal_id__uuid=uuid(g)) for g in (1, 1, 1, 2, 2)]
    messages = [("/spin/_action/feedback", SPIN, m, START + k) for k, m in enumerate(items)]

    (rows,), losses = rows_of(recorded(logs, messages))

    assert told(rows) == [("spin", "executing")] * 2
    assert rows.t_log_ns.tolist() == [START, START + 3]
    assert losses == []


def test_each_recovery_that_a_navigation_counts_is_a_row(logs):
    counts = [(1, 0), (1, 0), (1, 1), (1, 3), (2, 0), (2, 1), (2, 1), (3, 2)]
    items = [
        logs.make(as_message(TO_POSE), goal_id__uuid=uuid(g), feedback__number_of_recoveries=n)
        for g, n in counts
    ]
    messages = [("/to/_action/feedback", TO_POSE, m, START + k) for k, m in enumerate(items)]

    (rows,), _ = settle_changes(rows_of(recorded(logs, messages))[0])

    assert [(n, t - START) for n, t in zip(rows.columns["name"], rows.t_log_ns, strict=True)] == [
        ("recovery 1", 2), ("recovery 2", 3), ("recovery 3", 3), ("recovery 1", 5),
    ]  # fmt: skip
    assert set(rows.columns["source"]) == {"navigation_feedback"}
    assert set(rows.columns["goal"]) == {""}


@pytest.mark.parametrize("release", ["lyrical", "kilted", "galactic"])
def test_navigation_feedback_with_the_text_of_its_action_counts(logs, release):
    # Recorders since Kilted write down the .action itself.
    name = "nav2_msgs/action/NavigateThroughPoses"
    kind, text = f"{name}_FeedbackMessage", INTERFACES[name][release]
    store = get_typestore(Stores.ROS2_HUMBLE)
    waypoint = "nav2_msgs/msg/WaypointStatus"
    register_layout(store, waypoint, DEFINITIONS[waypoint])
    register_layout(store, kind, message_definition(kind, text))
    logs.stores[2] = store
    path = logs.folder / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schema = writer.register_schema(
            kind, "ros2msg", f"{SEPARATOR}ACTION: {name}\n{text}".encode()
        )
        channel = writer.register_channel("/navigate/_action/feedback", "cdr", schema)
        for t_ns, count in enumerate((0, 2)):
            message = logs.make(as_message(kind), feedback__number_of_recoveries=count)
            data = bytes(store.serialize_cdr(message, as_message(kind)))
            writer.add_message(channel, log_time=t_ns, publish_time=t_ns, data=data)
        writer.finish()

    read, losses = rows_of(path)
    (rows,), _ = settle_changes(read)

    assert told(rows) == [("recovery 1", "running"), ("recovery 2", "running")]
    assert losses == []


def test_a_db3_of_humble_is_read_without_any_definition(logs):
    tree, change = "nav2_msgs/msg/BehaviorTreeLog", "nav2_msgs/msg/BehaviorTreeStatusChange"
    spin = logs.make(change, node_name="Spin", previous_status="IDLE", current_status="RUNNING")
    messages = [
        ("/behavior_tree_log", tree, logs.make(tree, event_log=[spin]), START),
        ("/spin/_action/feedback", SPIN, logs.make(as_message(SPIN)), START),
        ("/navigate_to_pose/_action/feedback", TO_POSE, logs.make(as_message(TO_POSE)), START),
    ]

    rows, losses = rows_of(recorded(logs, messages))

    assert [(r.topic, told(r)) for r in rows] == [
        ("/behavior_tree_log", [("Spin", "running")]),
        ("/navigate_to_pose/_action/feedback", [("recovery 0", "running")]),
        ("/spin/_action/feedback", [("spin", "executing")]),
    ]
    assert losses == []


# --- service events -------------------------------------------------------------------------


def called(logs, kind, number, event, **values):
    message = logs.make(
        as_message(kind), info__event_type=event, info__sequence_number=number, **values
    )
    message.info.stamp.sec = 5
    return message


def test_a_call_is_one_request_and_one_answer_however_often_it_is_seen(logs):
    response = "nav2_msgs/msg/ClearEntireCostmap_Response"
    items = [called(logs, CLEAR, 1, e) for e in (0, 1)]
    items += [called(logs, CLEAR, 1, e, response=[logs.make(response)]) for e in (2, 3)]
    items.append(called(logs, CLEAR, 2, 0))

    decoded = decode(CLEAR, *items, topic="/c/clear_entirely_local_costmap/_service_event")

    name = "clear_entirely_local_costmap"
    assert pairs(decoded) == [(name, "running"), (name, "success"), (name, "running")]
    assert decoded.rows.tolist() == [0, 2, 4]
    assert decoded.t_sensor_ns.tolist() == [5 * 10**9] * 3


def test_a_service_without_contents_is_a_recovery_by_its_name(logs):
    kind = "std_srvs/srv/Empty_Event"
    topics = ("/reinitialize_global_localization/_service_event", "/r/save/_service_event")
    messages = [(topic, kind, called(logs, kind, 1, 1), START) for topic in topics]

    rows, losses = rows_of(recorded(logs, messages))

    assert [told(r) for r in rows] == [[], [("reinitialize_global_localization", "running")]]
    assert [(loss.what, loss.count) for loss in losses] == [("/r/save/_service_event", 1)]
    assert choose_recovery(rows).rows.topic == topics[0]


def test_the_newer_service_says_whether_it_cleared(logs):
    store = get_typestore(Stores.ROS2_HUMBLE)
    register_layout(store, CLEAR, layouts(CLEAR)[0])
    logs.stores[2] = store
    answers = [logs.make("nav2_msgs/msg/ClearEntireCostmap_Response", success=ok) for ok in (1, 0)]
    items = [called(logs, CLEAR, n, 2, response=[a]) for n, a in enumerate(answers)]

    assert [s for _, s in pairs(decode(CLEAR, *items))] == ["success", "failure"]


def test_a_goal_that_was_sent_is_pending_until_it_is_refused(logs):
    ask, answer = (f"nav2_msgs/msg/Spin_SendGoal_{part}" for part in ("Request", "Response"))
    asked = [[logs.make(ask, goal_id__uuid=uuid(g))] for g in (1, 2)]
    items = [
        called(logs, SEND, 1, 1, request=asked[0]),
        called(logs, SEND, 1, 2, response=[logs.make(answer, accepted=True)]),
        called(logs, SEND, 2, 1, request=asked[1]),
        called(logs, SEND, 2, 2, response=[logs.make(answer, accepted=False)]),
    ]
    topic = "/spin/_action/send_goal/_service_event"
    decoded = decode(SEND, *items, topic=topic)
    other = decode(SEND, *items, topic="/follow/_action/send_goal/_service_event")

    assert pairs(decoded) == [("spin", "pending"), ("spin", "pending"), ("spin", "rejected")]
    assert [g[:2] for g in decoded.columns["goal"]] == ["01", "02", "02"]
    assert len(other.rows) == 0


def test_events_without_contents_are_told_apart_by_their_call(logs):
    items = [called(logs, SEND, n, 1) for n in (1, 1, 2)]

    decoded = decode(SEND, *items, topic="/spin/_action/send_goal/_service_event")

    assert decoded.rows.tolist() == [0, 2]
    assert len(set(decoded.columns["goal"])) == 2


# --- ROS 1 ----------------------------------------------------------------------------------


def test_move_base_and_move_base_flex_in_a_bag(logs):
    goal, result = (f"mbf_msgs/msg/RecoveryAction{part}" for part in ("Goal", "Result"))
    base = "move_base_msgs/msg/MoveBaseActionResult"
    status = logs.make("actionlib_msgs/msg/GoalStatus", 1, status=1, goal_id__id="a")
    ended = {"status__goal_id__id": "b", "status__status": 3}
    messages = [
        ("/r/move_base_flex/recovery/goal", goal,
         logs.make(goal, 1, goal_id__id="b", goal__behavior="rotate")),
        ("/r/move_base_flex/recovery/result", result,
         logs.make(result, 1, result__outcome=150, result__used_plugin="rotate", **ended)),
        ("/move_base/status", GOAL_ROS1, logs.make(GOAL_ROS1, 1, status_list=[status])),
        ("/move_base/result", base,
         logs.make(base, 1, status__status=4, status__goal_id__id="a")),
    ]  # fmt: skip

    rows, losses = read(logs, "a.bag", *messages, ros=1)

    assert {r.topic: told(r) for r in rows} == {
        "/r/move_base_flex/recovery/goal": [("rotate", "pending")],
        "/r/move_base_flex/recovery/result": [("rotate", "aborted")],  # its outcome, not its status
        "/move_base/status": [("move_base", "active")],
        "/move_base/result": [("move_base", "aborted")],
    }
    assert losses == []


def test_a_path_that_was_driven_is_no_news(logs):
    kind = "mbf_msgs/msg/ExePathActionResult"
    items = [logs.make(kind, result__outcome=n, result__message="m") for n in (0, 101, 110)]

    decoded = decode(kind, *items)

    assert decoded.columns["message"].tolist() == ["outcome 110: m"]


def test_safety_devices_speak_when_something_changes(logs):
    kind = "nav2_msgs/msg/CollisionMonitorState"
    states = [(0, ""), (1, "front"), (1, "front"), (0, ""), (9, "")]
    items = [logs.make(kind, action_type=a, polygon_name=p) for a, p in states]

    decoded = decode(kind, *items)

    assert decoded.rows.tolist() == [0, 1, 3, 4]
    assert [m.removeprefix("collision monitor: ") for m in decoded.columns["message"]] == [
        "released", "stop by polygon front", "released", "unknown action",
    ]  # fmt: skip


# --- log lines ------------------------------------------------------------------------------


def lines(*texts, kind="rcl_interfaces/msg/Log", topic="/rosout"):
    """Rows of a log topic, of (node, text)."""
    t = START + np.arange(len(texts)) * 10**9
    node, text = np.array(texts, dtype=object).reshape(-1, 2).T
    columns = {"level": np.zeros(len(t), dtype=np.int32), "name": node, "message": text}
    return TopicRows(topic, kind, len(t), "health", columns, t, t)


GIVEN_UP = (
    "Aborting because a valid control could not be found. "
    "Even after executing all recovery behaviors"
)
LINES = [
    ("behavior_server", "Running spin", "spin", "running"),
    ("recoveries_server", "Attempting backup", "backup", "running"),
    ("behavior_server", "spin completed successfully", "spin", "success"),
    ("behavior_server", "backup failed", "backup", "failure"),
    ("behavior_server", "Initial checks failed for wait", "wait", "failure"),
    ("local_costmap.local_costmap", "Received request to clear entirely the local_costmap",
     "clear local_costmap", "running"),
    ("/move_base", "Clearing costmap to unstick robot (3.000000m).", "clearing costmap", "running"),
    ("/move_base", "Clearing both costmaps to unstuck robot (1.84m).", "clearing both costmaps",
     "running"),
    ("/move_base", "Clearing local costmap outside a square (3.00m) large centered on the robot.",
     "clearing local costmap", "running"),
    ("/move_base", "Rotate recovery behavior started.", "rotate recovery", "running"),
    ("/move_base", "Move slow and clear recovery behavior started.", "move slow and clear recovery",
     "running"),
    ("/move_base", GIVEN_UP, "move_base", "aborted"),
    ("bt_navigator", "Begin navigating from current location (0.00, 0.10) to (2.00, 3.00)",
     "navigate_to_pose", "running"),
    ("bt_navigator", "Goal failed error_code:9000 error_msg:''", "navigate_to_pose", "failed"),
]  # fmt: skip
OTHER_LINES = [
    ("behavior_server", "Running Nav2 LifecycleNode rcl preshutdown (behavior_server)"),
    ("behavior_server", "Configuring spin"),
    ("planner", "planning failed"),
    ("arm", "Goal succeeded"),
    ("costmap", "Recovery behavior will clear layer 'obstacles'"),
]


@pytest.mark.parametrize(("node", "text", "name", "status"), LINES)
def test_lines_of_navigators_tell_of_recoveries(node, text, name, status):
    (rows,) = told_in_logs([lines(*OTHER_LINES, (node, text))])

    assert told(rows) == [(name, status)]
    assert rows.columns["source"].tolist() == ["log"]
    assert rows.t_log_ns.tolist() == [START + len(OTHER_LINES) * 10**9]


def test_other_lines_tell_of_nothing_and_are_no_recovery_role():
    assert told_in_logs([lines(*OTHER_LINES)]) == []
    goals = told_in_logs([lines(("bt_navigator", "Goal failed"))])
    assert choose_recovery(goals) is None


def test_a_line_on_rosout_and_rosout_agg_is_one():
    kind, spin = "rosgraph_msgs/msg/Log", ("/move_base", "Rotate recovery behavior started.")
    both = [lines(spin, kind=kind), lines(spin, kind=kind, topic="/rosout_agg")]

    assert [r.topic for r in told_in_logs(both)] == ["/rosout"]
    assert [r.topic for r in told_in_logs(both[1:])] == ["/rosout_agg"]


# --- the whole log --------------------------------------------------------------------------


def test_goals_of_several_files_are_told_of_once_and_history_is_none(logs):
    topic = "/spin/_action/status"
    first = [statuses(logs, (1, 4), (2, 2)), statuses(logs, (1, 4), (2, 2))]
    second = [statuses(logs, (2, 2), (3, 2)), statuses(logs, (2, 4), (3, 2))]
    paths = []
    for k, part in enumerate((first, second)):
        times = [START + (10 * k + i) * 10**9 for i in range(2)]
        messages = [(topic, GOAL, m, t) for m, t in zip(part, times, strict=True)]
        paths.append(logs.write(f"{k}.mcap", messages))
    with open_log(paths) as (readers, _):
        rows, _ = read_rows(readers, lambda _topic: None, None)

    (settled,), losses = settle_changes(rows)

    assert goals_of(settled) == [
        ("02", "executing"), ("03", "executing"), ("02", "succeeded"),
    ]  # fmt: skip
    assert [(loss.count, loss.reason) for loss in losses] == [
        (1, "goals that had ended before the log began")
    ]


@pytest.mark.parametrize("size", [1, 2, 3])
def test_the_parts_in_which_a_log_is_read_change_nothing(logs, size):
    state = "nav2_msgs/msg/CollisionMonitorState"
    arrays = [
        [(1, 2)],
        [(1, 6), (2, 1)],
        [(1, 6), (2, 2)],
        [(1, 6), (2, 2)],
        [(1, 6), (2, 6)],
        [(2, 6)],
    ]
    counts, actions = (0, 1, 1, 3, 3, 4), (0, 1, 1, 1, 0, 0)
    messages = []
    for k, (array, count, action) in enumerate(zip(arrays, counts, actions, strict=True)):
        feedback = logs.make(as_message(TO_POSE), feedback__number_of_recoveries=count)
        monitor = logs.make(state, action_type=action)
        messages += [
            ("/spin/_action/status", GOAL, statuses(logs, *array), START + k),
            ("/navigate_to_pose/_action/feedback", TO_POSE, feedback, START + k),
            ("/collision_monitor_state", state, monitor, START + k),
        ]
    parts = [messages[i : i + 3 * size] for i in range(0, len(messages), 3 * size)]
    paths = [
        recorded(logs, part).rename(logs.folder / f"{size}_{k}.db3") for k, part in enumerate(parts)
    ]
    with open_log(paths) as (readers, _):
        rows, _ = settle_changes(read_rows(readers, lambda _topic: None, None)[0])
    counted, goals, monitored = (
        next(r for r in rows if word in r.topic) for word in ("feedback", "spin", "collision")
    )

    assert [t - START for t in counted.t_log_ns] == [1, 3, 3, 5]
    assert [t - START for t in monitored.t_log_ns] == [0, 1, 4]
    assert goals_of(goals) == [
        ("01", "executing"), ("01", "preempted"), ("02", "accepted"), ("02", "executing"),
        ("02", "aborted"),
    ]  # fmt: skip


def moving(logs, n=20):
    kind = "nav_msgs/msg/Odometry"
    for k in range(n):
        t = START + k * 10**8
        odometry = logs.make(
            kind, header__stamp__sec=t // 10**9, header__stamp__nanosec=t % 10**9,
            header__frame_id="odom", child_frame_id="base_link", pose__pose__orientation__w=1.0,
        )  # fmt: skip
        yield ("/odom", kind, odometry, t)


def bundle_of(logs, tmp_path, messages, name="a.db3"):
    path = recorded(logs, [*moving(logs), *messages]).rename(logs.folder / name)
    return ingest([path], tmp_path / f"{name}.bundle")


def test_a_navigator_is_believed_before_single_actions_and_log_lines(logs, tmp_path):
    log = "rcl_interfaces/msg/Log"
    said = logs.make(log, name="behavior_server", msg="Running spin")
    messages = [
        ("/rosout", log, said, START),
        ("/spin/_action/status", GOAL, statuses(logs, (1, 2)), START),
        ("/navigate_to_pose/_action/status", GOAL, statuses(logs, (5, 2)), START),
        ("/navigate_to_pose/_action/feedback", TO_POSE, logs.make(as_message(TO_POSE)), START),
    ]
    played = {}
    for count in range(1, len(messages) + 1):
        bundle = bundle_of(logs, tmp_path, messages[:count], f"{count}.db3")
        played[count] = bundle.manifest.topic_of("recovery")
    table = bundle.table("recoveries")

    assert played == {
        1: "/rosout",
        2: "/spin/_action/status",
        3: "/spin/_action/status",
        4: "/navigate_to_pose/_action/feedback",
    }
    assert sorted(zip(table["name"], table["source"], strict=True)) == [
        ("navigate_to_pose", "action"), ("spin", "action"), ("spin", "log"),
    ]  # fmt: skip
    assert "recovery" not in [m.part for m in bundle.manifest.missing]
    assert len(bundle.table("health")) == 1
    repaired = {loss.what: loss.count for loss in bundle.manifest.losses if loss.kind == "repaired"}
    assert repaired == {"/rosout": 1}  # its stamp is zero, and it is counted once


def test_goals_alone_are_no_word_of_recoveries(logs, tmp_path):
    status = statuses(logs, (1, 2))
    bundle = bundle_of(logs, tmp_path, [("/navigate_to_pose/_action/status", GOAL, status, START)])

    (missing,) = [m for m in bundle.manifest.missing if m.part == "recovery"]
    assert missing.consequence == "recoveries can only be inferred from motion and costmaps"
    assert len(bundle.table("recoveries")) == 1
