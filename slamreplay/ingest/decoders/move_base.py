"""ROS 1's move_base and move_base_flex: goals, what runs, and how it ended, as actionlib sends it.

move_base_flex sets a recovery that failed to SUCCEEDED and says so in its own `outcome`, which
counts here: 0 to 9 is a success, a number for each action is "cancelled", all else has failed.
Sources: mbf_msgs/action/{Recovery,MoveBase,ExePath}.action, mbf_abstract_nav/recovery_action.cpp.
"""

from __future__ import annotations

import numpy as np

from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.decoders.recovery_rows import (
    STATUS_ROS1,
    Texts,
    first_of_each,
    recovery_columns,
    words,
)

_NO_ERROR = 10
_CANCELED = {"recovery": 151, "move_base": 11, "exe_path": 101}


def _navigation_goal(messages: Messages) -> Decoded:
    return _rows(messages, "move_base", "pending", "goal_id.id")


def _navigation_feedback(messages: Messages) -> Decoded:
    """The first of each goal; later ones say where the robot is, which poses say better."""
    goal = messages.texts("status.goal_id.id")
    columns = recovery_columns("move_base", "active", goal, "action", len(messages))
    return kept(first_of_each(goal), columns, messages.every, messages.stamps(), ())


def _navigation_result(messages: Messages) -> Decoded:
    status = words(messages.column("status.status", np.int64), STATUS_ROS1)
    if messages.has("result.outcome"):
        status = _outcomes(messages, "move_base", status)
    return _rows(messages, "move_base", status, "status.goal_id.id")


def _recovery_goal(messages: Messages) -> Decoded:
    return _rows(messages, messages.texts("goal.behavior"), "pending", "goal_id.id")


def _recovery_result(messages: Messages) -> Decoded:
    status = words(messages.column("status.status", np.int64), STATUS_ROS1)
    plugin = messages.texts("result.used_plugin")
    name = np.where(plugin == "", "recovery", plugin).astype(object)
    return _rows(messages, name, _outcomes(messages, "recovery", status), "status.goal_id.id")


def _path_result(messages: Messages) -> Decoded:
    """Why the controller gave a path up: it is no recovery, but what recoveries come of."""
    outcome = messages.column("result.outcome", np.int64)
    failed = (outcome >= _NO_ERROR) & (outcome != _CANCELED["exe_path"])
    texts = messages.texts("result.message")
    message = np.empty(len(messages), dtype=object)
    message[:] = [f"outcome {n}: {text}" for n, text in zip(outcome, texts, strict=True)]
    columns = {
        "level": outcome.astype(np.int32),
        "name": np.full(len(messages), "exe_path", dtype=object),
        "message": message,
    }
    return kept(failed, columns, messages.every, messages.stamps(), ())


def _outcomes(messages: Messages, action: str, status: Texts) -> Texts:
    """The status in words, where move_base_flex's own outcome says more."""
    outcome = messages.column("result.outcome", np.int64)
    canceled = outcome == _CANCELED[action]
    told = np.where(canceled, "canceled", np.where(outcome < _NO_ERROR, "succeeded", "aborted"))
    return np.where(status == "succeeded", told, status).astype(object)


def _rows(messages: Messages, name: str | Texts, status: str | Texts, goal: str) -> Decoded:
    columns = recovery_columns(name, status, messages.texts(goal), "action", len(messages))
    return Decoded(columns, messages.every, messages.stamps())


GOAL = Decoder("recoveries", _navigation_goal)
FEEDBACK = Decoder("recoveries", _navigation_feedback)
RESULT = Decoder("recoveries", _navigation_result)
RECOVERY_GOAL = Decoder("recoveries", _recovery_goal)
RECOVERY_RESULT = Decoder("recoveries", _recovery_result)
PATH_RESULT = Decoder("health", _path_result)
