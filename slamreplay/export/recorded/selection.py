"""Which rows a cut is made of: those of its window, and those that still hold in it.

Carried along from before the window are static transforms, of each moving edge the last sample (the
correction map -> odom is one), the localizer's last word, and of a costmap that is told of in
windows the last whole grid. Their header stamps stay; their log time becomes that of the window's
first message, so that a player does not wait for them. Of each moving edge the first sample after
the window is carried, too: without it nothing could be interpolated at the window's end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.export.request import Window
from slamreplay.geometry.times import NS_PER_S, Times
from slamreplay.ingest.sightings import is_tag_frame

#: Nothing is interpolated to a sample that comes later than this.
MARGIN_NS = NS_PER_S
#: A pose told longer before the window than this would be taken for one of another clock.
OLDEST_POSE_NS = 50 * NS_PER_S
_SENSORS = ("scans", "odometry", "imu", "points", "commands", "transforms", "poses")


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one table to be written, in the order of log time.

    Attributes:
        table: the rows.
        t_log_ns: (N,) their log times in the new log.
    """

    table: Table
    t_log_ns: Times

    def __len__(self) -> int:
        return len(self.table)

    def take(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Rows:
        """The rows at an index array or under a mask."""
        return Rows(self.table.take(index), self.t_log_ns[index])

    def of_topics(self) -> dict[str, Rows]:
        """The rows of each topic, by name."""
        topics = self.table["topic"]
        return {str(name): self.take(topics == name) for name in sorted(set(topics.tolist()))}


def selected(bundle: Bundle, window: Window | None) -> tuple[dict[str, Rows], int]:
    """The rows of every table, and the log time at which the new log starts."""
    kept = {name: _kept(bundle, name, window) for name in TABLES}
    inside = {name: bundle.table(name).take(index) for name, index in kept.items()}
    if window is not None:
        kept["transforms"] = _transforms(bundle.table("transforms"), window)
        kept["poses"] = _held(bundle.table("poses"), window, kept["poses"])
        kept["initial_poses"] = _held(bundle.table("initial_poses"), window, kept["initial_poses"])
        kept |= _costmaps(bundle, window, kept)
    first = [inside[n]["t_log_ns"].min() for n in _SENSORS if len(inside[n])]
    low = int(min(first, default=bundle.manifest.start_ns))
    found = {}
    for name, index in kept.items():
        table = bundle.table(name).take(index)
        t_log_ns = table["t_log_ns"]
        if window is not None:
            carried = table.t_ns < window.start_ns
            t_log_ns = np.where(carried, np.maximum(t_log_ns, low), t_log_ns)
            if name == "transforms":  # what is fixed held before it was told, too
                late = table["is_static"] & (table.t_ns > window.end_ns)
                t_log_ns = np.where(late, low, t_log_ns)
        order = np.argsort(t_log_ns, kind="stable")
        found[name] = Rows(table.take(order), t_log_ns[order])
    return found, low


def _kept(bundle: Bundle, name: str, window: Window | None) -> NDArray[np.int64]:
    t_ns = bundle.table(name).t_ns
    return np.arange(len(t_ns)) if window is None else np.flatnonzero(window.holds(t_ns))


def _transforms(table: Table, window: Window) -> NDArray[np.int64]:
    """With the neighbours of the window of each edge; of a static one, one sample is enough."""
    keep = window.holds(table.t_ns)
    edges: dict[tuple[str, str, bool], list[int]] = {}
    names = (table["parent_frame"], table["child_frame"], table["is_static"].tolist())
    for row, edge in enumerate(zip(*names, strict=True)):
        edges.setdefault(edge, []).append(row)
    for (_, child, is_static), members in edges.items():
        if is_tag_frame(child) and not is_static:
            continue  # a sighting says where a tag was then, and nothing of later
        rows = np.array(members)
        before = rows[table.t_ns[rows] < window.start_ns]
        after = rows[table.t_ns[rows] > window.end_ns][:1]
        near = table.t_ns[after] <= window.end_ns + MARGIN_NS
        keep[before[-1:]] = True
        keep[after] |= ~keep[rows].any() if is_static else near
    return np.flatnonzero(keep)


def _held(table: Table, window: Window, inside: NDArray[np.int64]) -> NDArray[np.int64]:
    """With the last row before the window of each topic, unless it is long ago."""
    near = (table.t_ns < window.start_ns) & (table.t_ns >= window.start_ns - OLDEST_POSE_NS)
    last = {table["topic"][row]: row for row in np.flatnonzero(near).tolist()}
    return np.union1d(inside, np.array(list(last.values()), dtype=np.int64))


def _costmaps(
    bundle: Bundle, window: Window, kept: dict[str, NDArray[np.int64]]
) -> dict[str, NDArray[np.int64]]:
    """Whole grids and windows of the costmaps that windows in the cut belong to."""
    grids, windows = bundle.table("costmaps"), bundle.table("costmap_updates")
    whole, parts = [kept["costmaps"]], [kept["costmap_updates"]]
    for topic in sorted(set(windows["grid_topic"].tolist())):
        before = np.flatnonzero((grids["topic"] == topic) & (grids.t_ns < window.start_ns))
        if len(before):
            own = windows["grid_topic"] == topic
            own &= (windows.t_ns >= grids.t_ns[before[-1]]) & (windows.t_ns < window.start_ns)
            whole.append(before[-1:])
            parts.append(np.flatnonzero(own))
    return {
        "costmaps": np.unique(np.concatenate(whole)),
        "costmap_updates": np.unique(np.concatenate(parts)),
    }
