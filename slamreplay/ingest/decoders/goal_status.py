"""action_msgs and actionlib_msgs GoalStatusArray: what became of recoveries and navigations.

The array lists every goal the server remembers, again and again; a row is one goal's change. Whose
goals they are stands in the topic's name alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.recoveries import NAVIGATIONS
from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.action_names import action_of, is_recovery
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.recovery_rows import (
    STATUS,
    STATUS_ROS1,
    Texts,
    first_of_each,
    hexadecimal,
    recovery_columns,
    until_ended,
    words,
)

_LIVE = ("accepted", "executing")


def _ros2(messages: Messages) -> Decoded:
    goals, rows = messages.children("status_list")
    status = words(goals.column("status", np.int64), STATUS)
    # Nav2's servers abort a goal for a newer one: it was replaced, and did not fail.
    has_live = np.zeros(len(messages), dtype=bool)
    has_live[rows[np.isin(status.astype(str), _LIVE)]] = True
    status[(status == "aborted") & has_live[rows]] = "preempted"
    goal = hexadecimal(goals.fixed("goal_info.goal_id.uuid", 16))
    return _changes(messages, rows, goal, status, np.full(len(messages), NO_STAMP))


def _ros1(messages: Messages) -> Decoded:
    goals, rows = messages.children("status_list")
    status = words(goals.column("status", np.int64), STATUS_ROS1)
    return _changes(messages, rows, goals.texts("goal_id.id"), status, messages.stamps())


def _changes(
    messages: Messages, rows: NDArray[np.int64], goal: Texts, status: Texts, stamps: Times
) -> Decoded:
    """One row for each status that a goal comes to have, until it has ended."""
    action = action_of(messages.topic)
    wanted = is_recovery(action) or action in NAVIGATIONS
    keep = first_of_each(goal + "\n" + status) & until_ended(goal, status) & wanted
    columns = recovery_columns(action, status, goal, "action", len(rows))
    unused = 0 if wanted else len(messages)
    remarks = (Remark("skipped", unused, "goals of an action that is no recovery or navigation"),)
    return kept(keep, columns, rows, stamps[rows], remarks)


GOAL_STATUS = Decoder("recoveries", _ros2)
GOAL_STATUS_ROS1 = Decoder("recoveries", _ros1)
