"""Recoveries and goals that a navigator's log lines tell of.

The wording is that of nav2_behaviors (timed_behavior.hpp; "Attempting" until Foxy), nav2_costmap_2d
(clear_costmap_service.cpp), nav2_bt_navigator (bt_action_server_impl.hpp, navigate_to_pose.cpp),
and of ROS 1's move_base, rotate_recovery, move_slow_and_clear and clear_costmap_recovery.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slamreplay.ingest.action_names import is_recovery
from slamreplay.ingest.decoders.recovery_rows import recovery_columns
from slamreplay.ingest.names import basename
from slamreplay.ingest.rows import TopicRows

_LOGS = frozenset({"rcl_interfaces/msg/Log", "rosgraph_msgs/msg/Log", "foxglove_msgs/msg/Log"})
#: Lines of behaviours, whose group is the behaviour: only those called like a recovery count.
_BEHAVIOURS = (
    (re.compile(r"(?:Running|Attempting) (\S+)"), "running"),
    (re.compile(r"(\S+) completed successfully"), "success"),
    (re.compile(r"(\S+) failed\b.*"), "failure"),
    (re.compile(r"Initial checks failed for (\S+?)(?: -.*)?"), "failure"),
    (re.compile(r"Canceling (\S+)"), "canceled"),
)
_RECOVERIES = (
    re.compile(r"Received request to (clear)\b.*?(\w*costmap)\w*"),
    re.compile(r"(Clearing) ((?:\w+ )?costmaps?) (?:to unst[iu]ck|(?:in|out)side a square).*"),
    re.compile(r"([\w ]+ recovery) behavior (started)\.?"),
)  # fmt: skip
_BEGUN = re.compile(r"Begin navigating from current (?:location|position)\b.*")
_ENDED = re.compile(r"Goal (succeeded|failed|canceled)\b.*")
_GIVEN_UP = re.compile(r"Aborting because .*[Ee]ven after executing all recovery behaviors\.?")


def told_in_logs(topics: Sequence[TopicRows]) -> list[TopicRows]:
    """Rows of table `recoveries`, source log, from the lines of log topics that tell of them."""
    logs = [t for t in topics if t.table == "health" and t.type in _LOGS]
    # ROS 1 sends every line on /rosout and again on /rosout_agg.
    plain = [t for t in logs if not basename(t.topic).endswith("_agg")]
    found = []
    for topic in plain or logs:
        lines = zip(topic.columns["name"], topic.columns["message"], strict=True)
        told = {i: row for i, line in enumerate(lines) if (row := told_of(*line)) is not None}
        if told:
            rows = topic.take(np.array(list(told), dtype=np.int64))
            name, status = np.array(list(told.values()), dtype=object).T
            columns = recovery_columns(name, status, "", "log", len(rows))
            found.append(replace(rows, table="recoveries", columns=columns, messages=len(rows)))
    return found


def is_told_in_log(topic: TopicRows) -> bool:
    """Whether rows come from lines of a log topic, whose own rows are there too."""
    return topic.table == "recoveries" and topic.type in _LOGS


def told_of(node: str, line: str) -> tuple[str, str] | None:
    """Name and status of the recovery or the navigation a line tells of, None for other lines."""
    line = line.strip()
    for pattern, status in _BEHAVIOURS:
        match = pattern.fullmatch(line)
        if match and is_recovery(match[1]):
            return match[1], status
    for pattern in _RECOVERIES:
        match = pattern.fullmatch(line)
        if match:
            name = match[1] if match[2] == "started" else " ".join(match.groups())
            return name.lower(), "running"
    if _GIVEN_UP.fullmatch(line):
        return "move_base", "aborted"
    if "bt_navigator" not in node:
        return None
    if _BEGUN.fullmatch(line):
        return "navigate_to_pose", "running"
    match = _ENDED.fullmatch(line)
    return ("navigate_to_pose", match[1]) if match else None
