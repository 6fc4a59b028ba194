"""Messages that tell of changes, over the whole log: a decoder sees only a part of it at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.ingest.decoders.recovery_rows import FINAL, first_of_each, until_ended
from slamreplay.ingest.rows import TopicRows

_COUNTED = ("NavigateToPose_FeedbackMessage", "NavigateThroughPoses_FeedbackMessage",
            "DockRobot_FeedbackMessage")  # fmt: skip
_STATES = ("CollisionMonitorState", "CollisionDetectorState", "SpeedLimit")


def settle_changes(topics: Sequence[TopicRows]) -> tuple[list[TopicRows], list[Loss]]:
    """The topics with each change once, and what was history when the log began."""
    settled, losses = [], []
    for topic in topics:
        kind = topic.type.rpartition("/")[2]
        if not len(topic) or topic.table not in ("recoveries", "health"):
            settled.append(topic)
        elif kind in _COUNTED:
            settled.append(_counted(topic))
        elif kind in _STATES:
            message = topic.columns["message"]
            settled.append(topic.take(np.flatnonzero(np.append(True, message[1:] != message[:-1]))))
        elif topic.table == "recoveries" and (topic.columns["goal"] != "").any():
            goals, loss = _goals(topic)
            settled.append(goals)
            losses += loss
        else:
            settled.append(topic)
    return settled, losses


def _goals(topic: TopicRows) -> tuple[TopicRows, list[Loss]]:
    """Each status of a goal once and none after its end; none of goals that had ended before.

    A server remembers goals for minutes: those that the first message lists as ended ended earlier.
    """
    name, goal, status = (topic.columns[key] for key in ("name", "goal", "status"))
    keep = first_of_each(name + "\n" + goal + "\n" + status) & until_ended(goal, status)
    keep |= goal == ""
    losses = []
    if topic.type.endswith("/GoalStatusArray"):
        ended = np.isin(status.astype(str), FINAL) & (topic.t_log_ns == topic.t_log_ns[0])
        keep &= ~ended
        if count := int(ended.sum()):
            reason = "goals that had ended before the log began"
            losses.append(Loss(kind="skipped", what=topic.topic, count=count, reason=reason))
    return topic.take(np.flatnonzero(keep)), losses


def _counted(topic: TopicRows) -> TopicRows:
    """One row for each by which a goal's count has grown; `name` ends with the count.

    What a goal's first feedback in the log has counted came before it, and nobody knows when.
    """
    stem = str(topic.columns["name"][0]).rpartition(" ")[0]
    goal = topic.columns["goal"]
    count = np.array([int(n.rpartition(" ")[2]) for n in topic.columns["name"]], dtype=np.int64)
    _, number = np.unique(goal.astype(str), return_inverse=True)
    order = np.argsort(number, kind="stable")
    same_goal = number[order[1:]] == number[order[:-1]]
    grown = np.zeros(len(topic), dtype=np.int64)
    grown[order[1:]] = np.where(same_goal, np.diff(count[order]), 0).clip(min=0)
    rows = topic.take(np.repeat(np.arange(len(topic)), grown))
    nth = np.concatenate([c - np.arange(g)[::-1] for c, g in zip(count, grown, strict=True)])
    names = np.empty(len(rows), dtype=object)
    names[:] = [f"{stem} {n}" for n in nth]
    nobody = np.full(len(rows), "", dtype=object)
    return replace(rows, columns={**rows.columns, "name": names, "goal": nobody})
