"""When the robot began to recover, and when it had a goal, whichever way the log tells of them.

One recovery may be in a log five times: as a node of the tree, as a goal of its action, as that
action's feedback, as a line of text and in the navigator's count. Here it is one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.recoveries import INFERRED, NAVIGATIONS, kind_of_recovery
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.motion import Span

#: Repeated rows of one recovery within this are one recovery.
REPEAT_NS = 2 * NS_PER_S
#: Two sources that tell of one kind of recovery within this tell of the same one.
SAME_NS = 3 * NS_PER_S
#: Nav2's default trees: the node that runs as long as a goal is active, and the nodes that only
#: choose among recoveries.
NAVIGATION_NODE = "NavigateRecovery"
WRAPPERS = ("RecoveryFallback", "RecoveryActions", "ClearingActions")
_NAVIGATION = (NAVIGATION_NODE, *sorted(NAVIGATIONS))
_ABORTED = ("failure", "failed", "aborted")
_FINISHED = (
    "success", "succeeded", "failure", "failed", "aborted", "canceled", "preempted", "rejected",
    "recalled", "lost", "idle",
)  # fmt: skip
_ENDING = ("canceling", "preempting", "recalling")


@dataclass(frozen=True)
class Recovery:
    """The start of a recovery action; `inferred` where nobody recorded it."""

    t_ns: int
    name: str
    inferred: bool = False


def recoveries(view: BundleView) -> tuple[Recovery, ...]:
    """Starts of recovery actions, in time order; the tree nodes around them are left out."""
    table = view.table("recoveries")
    if not len(table):
        return ()
    table = table.sorted_by_time()
    names = table["name"].astype(str)
    table = table.take(~np.isin(names, _NAVIGATION))
    actions = ~np.isin(table["name"].astype(str), WRAPPERS)
    table = table.take(actions) if actions.any() else table
    if not len(table):
        return ()
    status = np.char.lower(table["status"].astype(str))
    begun = ~np.isin(status, (*_FINISHED, *_ENDING))
    return _once_each(table.take(begun) if begun.any() else table)


def _once_each(table: Table) -> tuple[Recovery, ...]:
    """One recovery for all rows that tell of it."""
    found: list[tuple[int, str, str]] = []
    last: dict[str, int] = {}
    goals: dict[str, int] = {}
    columns = (table[key].astype(str).tolist() for key in ("name", "source", "goal"))
    for t, name, source, goal in zip(table.t_ns.tolist(), *columns, strict=True):
        repeated = t - last.get(name, t - REPEAT_NS) < REPEAT_NS
        last[name] = t
        told = goals.get(goal) if goal else None
        if told is None and not repeated:
            told = _told_before(found, t, name, source)
        if told is not None:
            if not kind_of_recovery(found[told][1]) and kind_of_recovery(name):
                found[told] = (found[told][0], name, found[told][2])
        elif not repeated:
            told = len(found)
            found.append((t, name, source))
        if goal and told is not None:
            goals[goal] = told
    return tuple(Recovery(t, name, source == INFERRED) for t, name, source in found)


def _told_before(found: list[tuple[int, str, str]], t: int, name: str, source: str) -> int | None:
    """The recovery that another source has told of just before, where it may be the same."""
    kind = kind_of_recovery(name)
    for k in range(len(found) - 1, -1, -1):
        t_before, other, by = found[k]
        if t - t_before > SAME_NS:
            break
        other_kind = kind_of_recovery(other)
        if by != source and (kind == other_kind or not kind or not other_kind):
            return k
    return None


def navigations(view: BundleView) -> tuple[Span, ...] | None:
    """Times [start, end) with an active goal, as the log tells; None where it does not.

    An action's goals say it best, then the tree, then log lines. A navigation that the log does not
    see the end of lasts to the log's end.
    """
    table = _navigation_rows(view)
    sources = table["source"].astype(str)
    by_goal = table.take((sources == "action") & (table["goal"] != ""))
    finished = np.isin(by_goal["status"].astype(str), _FINISHED)
    tells_ends = finished | np.char.endswith(by_goal["topic"].astype(str), "status")
    if len(by_goal) and tells_ends.any():
        found = [
            _span(by_goal.take(by_goal["goal"] == goal)) for goal in sorted(set(by_goal["goal"]))
        ]
        spans = sorted((s for s in found if s is not None), key=lambda span: span[0])
        last = max(view.manifest.end_ns, 0)
        return tuple(Span(start, max(end or last, start)) for start, end in spans)
    for source in ("behavior_tree", "log"):
        rows = table.take(sources == source)
        if len(rows):
            return _in_turn(rows, view.manifest.end_ns)
    return None


def _navigation_rows(view: BundleView) -> Table:
    table = view.table("recoveries").sorted_by_time()
    return table.take(np.isin(table["name"].astype(str), _NAVIGATION))


def _span(rows: Table) -> tuple[int, int | None] | None:
    """From a goal's first row to its end; None for a goal whose end alone is in the log."""
    finished = np.isin(rows["status"].astype(str), _FINISHED)
    if finished[0]:
        return None
    return int(rows.t_ns[0]), int(rows.t_ns[finished][0]) if finished.any() else None


def _in_turn(table: Table, end_ns: int) -> tuple[Span, ...]:
    """One navigation after the other, from rows that do not say whose they are."""
    found, begun = [], None
    for t, status in zip(table.t_ns.tolist(), table["status"].astype(str).tolist(), strict=True):
        if status.lower() in _FINISHED:
            if begun is not None:
                found.append(Span(begun, t))
            begun = None
        elif begun is None:
            begun = t
    if begun is not None:
        found.append(Span(begun, max(end_ns, begun)))
    return tuple(found)


def aborted(view: BundleView) -> tuple[int, ...]:
    """Times at which a navigation ended without success."""
    table = _navigation_rows(view)
    status = np.char.lower(table["status"].astype(str)) if len(table) else np.zeros(0, dtype=str)
    return tuple(table.t_ns[np.isin(status, _ABORTED)].tolist())
