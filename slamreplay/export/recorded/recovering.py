"""Recoveries and goals as Nav2 tells them: statuses of goals, and the behaviour tree's log.

Goals of ROS 1's actionlib become goals of ROS 2, statuses in its words. What only a tree node's
name can tell (services, counts in feedback, move_base's recovery status) goes into the log of the
behaviour tree. Rows that were read out of log lines or inferred are not written: the lines and the
motion are there to read them from again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.recoveries import INFERRED, NAVIGATIONS
from slamreplay.export.formats import NotAsRecorded
from slamreplay.export.recorded.selection import Rows
from slamreplay.export.recorded.stream import Composer, Encoded, Stream, groups, header_stamps
from slamreplay.ingest.action_names import action_of, is_recovery

TREE_LOG = "/behavior_tree_log"
#: action_msgs/GoalStatus of the words of ROS 2, then of ROS 1.
_STATUS = {
    "accepted": 1, "executing": 2, "canceling": 3, "succeeded": 4, "canceled": 5, "aborted": 6,
    "pending": 1, "active": 2, "preempting": 3, "recalling": 3, "preempted": 5, "recalled": 5,
    "rejected": 6, "lost": 6,
}  # fmt: skip


def recovering(rows: Mapping[str, Rows], ros: Composer) -> Encoded:
    """Streams of the table recoveries."""
    own = rows["recoveries"]
    sources = own.table["source"].astype(str)
    own = own.take(~np.isin(sources, ["log", INFERRED]))
    goals = _are_goals(own)
    names = own.table["name"]
    nodes = ~goals & np.array([is_recovery(str(n)) for n in names], dtype=bool)
    streams = _goals(own.take(goals), ros) + _tree(own.take(nodes), ros)
    left = own.take(~goals & ~nodes)
    missed = [
        NotAsRecorded(topic, len(part), "states of actions that no message of ours tells")
        for topic, part in left.of_topics().items()
    ]
    moved = nodes & (own.table["source"] != "behavior_tree")
    for topic, part in own.take(moved).of_topics().items():
        missed.append(NotAsRecorded(topic, len(part), "told in the log of the behaviour tree"))
    for topic, part in own.take(goals).of_topics().items():
        if not topic.endswith("/_action/status"):
            missed.append(NotAsRecorded(topic, len(part), f"told on {_status_topic(topic)}"))
    return Encoded(streams, missed)


def _are_goals(rows: Rows) -> NDArray[np.bool_]:
    """(N,) rows that a status of the action which their topic belongs to tells in full."""
    t = rows.table
    told = [
        source == "action"
        and goal != ""
        and status in _STATUS
        and name == action_of(str(topic))
        and (is_recovery(name) or name in NAVIGATIONS)
        for source, goal, status, name, topic in zip(
            t["source"], t["goal"], t["status"], t["name"], t["topic"], strict=True
        )
    ]
    return np.array(told, dtype=bool)


def _goals(rows: Rows, ros: Composer) -> list[Stream]:
    """One topic an action, whichever of its topics told."""
    topics = np.array([_status_topic(str(t)) for t in rows.table["topic"]], dtype=object)
    ids = _goal_ids(rows)
    return [
        _of_action(str(topic), rows.take(topics == topic), ids, ros)
        for topic in sorted(set(topics.tolist()))
    ]


def _status_topic(topic: str) -> str:
    parts = topic.split("/")
    if "_action" in parts:
        return "/".join([*parts[: parts.index("_action") + 1], "status"])
    return "/".join([*parts[:-1], "_action", "status"])


def _goal_ids(rows: Rows) -> dict[str, NDArray[np.uint8]]:
    """16 bytes for each goal: its own where it is a UUID, else its number among all."""
    ids = {}
    for number, goal in enumerate(sorted(set(rows.table["goal"].tolist())), start=1):
        try:
            raw = bytes.fromhex(goal)
        except ValueError:
            raw = b""
        raw = raw if len(raw) == 16 else number.to_bytes(16, "big")
        ids[goal] = np.frombuffer(raw, dtype=np.uint8)
    return ids


def _of_action(
    topic: str, rows: Rows, ids: Mapping[str, NDArray[np.uint8]], ros: Composer
) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)
    found = groups(rows.t_log_ns)

    def status(row: int) -> Any:
        info = ros.make(
            "action_msgs/GoalInfo",
            goal_id=ros.make("unique_identifier_msgs/UUID", uuid=ids[t["goal"][row]]),
            stamp=ros.stamp(stamps[row]),
        )
        return ros.make("action_msgs/GoalStatus", goal_info=info, status=_STATUS[t["status"][row]])

    def message(i: int) -> Any:
        return ros.make(
            "action_msgs/GoalStatusArray", status_list=[status(r) for r in found[i].tolist()]
        )

    t_log_ns = rows.t_log_ns[[g[0] for g in found]]
    return Stream(topic, "action_msgs/GoalStatusArray", t_log_ns, message)


def _tree(rows: Rows, ros: Composer) -> list[Stream]:
    """Events of one moment make one message; all of them go to one topic."""
    if not len(rows):
        return []
    t, stamps = rows.table, header_stamps(rows.table)
    logs = t["topic"][t["source"] == "behavior_tree"]
    found = groups(rows.t_log_ns, stamps)

    def event(row: int) -> Any:
        status = str(t["status"][row]).upper()
        # A node that goes from idle to its end at once would be read as two rows.
        before = "IDLE" if status == "RUNNING" else "RUNNING"
        return ros.make(
            "nav2_msgs/BehaviorTreeStatusChange",
            timestamp=ros.stamp(stamps[row]),
            node_name=t["name"][row],
            uid=0,
            previous_status=before,
            current_status=status,
        )

    def message(i: int) -> Any:
        return ros.make(
            "nav2_msgs/BehaviorTreeLog",
            timestamp=ros.stamp(stamps[found[i][0]]),
            event_log=[event(row) for row in found[i].tolist()],
        )

    topic = str(logs[0]) if len(logs) else TREE_LOG
    t_log_ns = rows.t_log_ns[[g[0] for g in found]]
    return [Stream(topic, "nav2_msgs/BehaviorTreeLog", t_log_ns, message)]
