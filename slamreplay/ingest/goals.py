"""Goals of actions over the whole log, when all of its files have been read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.ingest.decoders.goal_status import FINAL
from slamreplay.ingest.decoders.recovery_rows import first_of_each
from slamreplay.ingest.rows import TopicRows


def settle_goals(topics: Sequence[TopicRows]) -> tuple[list[TopicRows], list[Loss]]:
    """The topics with each change of a goal once, and without goals that were history.

    Each file of a log begins with goals the one before has told of. A server also remembers goals
    for minutes after their end: those that its first message lists as ended did not end then.
    """
    settled, losses = [], []
    for topic in topics:
        if topic.table != "recoveries" or not (len(topic) and (topic.columns["goal"] != "").any()):
            settled.append(topic)
            continue
        name, goal, status = (topic.columns[key] for key in ("name", "goal", "status"))
        keep = first_of_each(name + "\n" + goal + "\n" + status) | (goal == "")
        if topic.type.endswith("/GoalStatusArray"):
            ended = np.isin(status.astype(str), FINAL) & (topic.t_log_ns == topic.t_log_ns[0])
            keep &= ~ended
            reason = "goals that had ended before the log began"
            count = int(ended.sum())
            if count:
                losses.append(Loss(kind="skipped", what=topic.topic, count=count, reason=reason))
        settled.append(topic.take(np.flatnonzero(keep)))
    return settled, losses
