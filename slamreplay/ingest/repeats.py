"""Rows that only say again what was said before: of states the changes are kept, of closures each.

Some messages tell a whole state or a whole graph every time. Decoders read them as they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from slamreplay.ingest.rows import TopicRows

#: What is said of them.
REPEATS = "rows that repeat what was told before"
#: Types that tell a whole state with every message, as health rows.
_STATES = frozenset({"sensor_msgs/msg/BatteryState", "dynamic_reconfigure/msg/Config"})


def without_repeats(topic: TopicRows) -> tuple[TopicRows, int]:
    """The topic's rows without repetitions, and how many those were."""
    columns = topic.columns
    if topic.type in _STATES:
        keep = _changes(columns["name"], columns["message"])
    elif topic.table == "closures":
        keep = _firsts(columns["kind"], columns["from_id"], columns["to_id"], columns["number"])
    else:
        return topic, 0
    repeats = int((~keep).sum())
    return (topic.take(np.flatnonzero(keep)), repeats) if repeats else (topic, 0)


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


def _firsts(
    kind: NDArray[np.object_],
    from_id: NDArray[np.object_],
    to_id: NDArray[np.object_],
    number: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """(N,) the first row of each closure, known by its ids or by its number among its kind.

    Lists grow at their end; what comes after a system has thinned its graph may be taken for what
    stood there before.
    """
    number = np.where(from_id == "", number, -1)
    keep = np.zeros(len(kind), dtype=bool)
    if len(kind):
        parts = np.array([kind, from_id, to_id, number], dtype=str)
        _, first = np.unique(parts, axis=1, return_index=True)
        keep[first] = True
    return keep
