"""Columns of the table `recoveries`, and the ids and status numbers they are made of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Texts = NDArray[np.object_]

#: action_msgs/GoalStatus by number.
STATUS = ("unknown", "accepted", "executing", "canceling", "succeeded", "canceled", "aborted")
#: actionlib_msgs/GoalStatus by number.
STATUS_ROS1 = (
    "pending", "active", "preempted", "succeeded", "aborted", "rejected", "preempting",
    "recalling", "recalled", "lost",
)  # fmt: skip
#: Statuses that a goal keeps.
FINAL = ("succeeded", "canceled", "aborted", "preempted", "rejected", "recalled", "lost")


def recovery_columns(
    name: str | Texts, status: str | Texts, goal: str | Texts, source: str, count: int
) -> dict[str, Texts]:
    """The table's columns for (count,) rows; what is one text holds for all of them."""
    columns: dict[str, str | Texts] = {"name": name, "status": status, "goal": goal}
    columns["source"] = source
    return {
        key: np.full(count, value, dtype=object) if isinstance(value, str) else value
        for key, value in columns.items()
    }


def words(numbers: NDArray[np.int64], known: tuple[str, ...]) -> Texts:
    """(N,) status numbers in words, "unknown" where a number has none."""
    table = np.array([*known, "unknown"], dtype=object)
    return table[np.where((numbers >= 0) & (numbers < len(known)), numbers, len(known))]


def hexadecimal(ids: NDArray[np.float64]) -> Texts:
    """(N,) ids of (N, K) bytes as text."""
    out = np.empty(len(ids), dtype=object)
    out[:] = [row.tobytes().hex() for row in ids.astype(np.uint8)]
    return out


def until_ended(goal: Texts, status: Texts) -> NDArray[np.bool_]:
    """(N,) whether a goal had not ended before a row, of rows in time order."""
    _, number = np.unique(goal.astype(str), return_inverse=True)
    order = np.argsort(number, kind="stable")
    final = np.isin(status[order].astype(str), FINAL).astype(np.int64)
    before = np.cumsum(final) - final
    start = np.flatnonzero(np.append(True, number[order[1:]] != number[order[:-1]])[: len(order)])
    before -= np.repeat(before[start], np.diff(np.append(start, len(order))))
    out = np.zeros(len(goal), dtype=bool)
    out[order] = before == 0
    return out


def first_of_each(keys: Texts) -> NDArray[np.bool_]:
    """(N,) whether a key is there for the first time."""
    _, first = np.unique(keys.astype(str), return_index=True)
    out = np.zeros(len(keys), dtype=bool)
    out[first] = True
    return out
