"""Rows that only say again what was said before: of states the changes are kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.ingest.rows import TopicRows

#: Types that tell a whole state with every message, as health rows.
_STATES = frozenset({"sensor_msgs/msg/BatteryState", "dynamic_reconfigure/msg/Config"})


def without_repeats(topic: TopicRows) -> tuple[TopicRows, list[Loss]]:
    """The topic's rows without repetitions, and how many those were."""
    if topic.type not in _STATES:
        return topic, []
    keep = _changes(topic.columns["name"], topic.columns["message"])
    repeats = int((~keep).sum())
    if not repeats:
        return topic, []
    loss = Loss(kind="skipped", what=topic.topic, count=repeats, reason="rows that repeat a state")
    return topic.take(np.flatnonzero(keep)), [loss]


def _changes(names: NDArray[np.object_], values: NDArray[np.object_]) -> NDArray[np.bool_]:
    """(N,) rows that are the first of a name, or differ from the name's row before."""
    keep = np.ones(len(names), dtype=bool)
    if not len(names):
        return keep
    _, which = np.unique(names.astype(str), return_inverse=True)
    order = np.argsort(which, kind="stable")
    same = which[order][1:] == which[order][:-1]
    same &= values[order][1:] == values[order][:-1]
    keep[order[1:]] = ~same
    return keep
