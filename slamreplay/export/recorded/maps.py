"""The map versions that held in the cut: latched, each when it began, and as map_server's files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.map_course import Held, map_course
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.export.formats import NotAsRecorded
from slamreplay.export.recorded.stream import Composer, Encoded, Stream
from slamreplay.export.request import Window
from slamreplay.geometry.times import NO_STAMP
from slamreplay.maps.map_server import map_files

MAP_TOPIC = "/map"


def maps(bundle: Bundle, window: Window, low_ns: int, ros: Composer) -> Encoded:
    """The stream of the map; a version that is told again while it holds is told once.

    Args:
        bundle: the log.
        window: from when to when.
        low_ns: log time of the new log's start, at which the first version is told.
        ros: makes messages.
    """
    held = _held(bundle, window)
    if not held:
        return Encoded([])
    updates = bundle.table("map_updates").sorted_by_time()
    versions = updates["map_version"].astype(str)
    rows = [_told_by(updates, versions == h.version, h.start_ns) for h in held]
    stamps = [NO_STAMP if row is None else updates["t_sensor_ns"][row] for row in rows]
    log = [low_ns if row is None else int(updates["t_log_ns"][row]) for row in rows]
    t_log_ns = np.maximum(np.array(log, dtype=np.int64), low_ns)
    if window.start_ns <= bundle.manifest.start_ns:
        t_log_ns[0] = log[0]  # nothing was cut before it
    elif rows[0] is not None and updates.t_ns[rows[0]] > window.end_ns:
        t_log_ns[0] = low_ns
    topics = [str(t) for t in updates["topic"].tolist() if str(t).startswith("/")]
    topic = topics[-1] if topics else MAP_TOPIC

    def message(i: int) -> Any:
        grid = bundle.grid(held[i].version)
        assert grid is not None
        stamp = 0 if stamps[i] == NO_STAMP else int(stamps[i])
        return ros.grid(stamp, grid.frame_id, grid.cells, grid.resolution_m, grid.origin_xyyaw)

    inside = window.holds(updates.t_ns)
    kept = np.isin(versions, bundle.map_versions)
    missed = []
    if thinned := int((inside & ~kept).sum()):
        reason = "map versions that the bundle did not keep: the one before stands in"
        missed.append(NotAsRecorded(topic, thinned, reason))
    order = np.argsort(t_log_ns, kind="stable")
    stream = Stream(
        topic,
        "nav_msgs/OccupancyGrid",
        t_log_ns[order],
        lambda i: message(int(order[i])),
        latched=True,
    )
    return Encoded([stream], missed)


def _told_by(updates: Table, mine: NDArray[np.bool_], start_ns: int) -> int | None:
    """The row that told of a version which holds from a time on: the last before, or the first."""
    rows = np.flatnonzero(mine)
    before = rows[updates.t_ns[rows] <= start_ns]
    chosen = before[-1:] if len(before) else rows[:1]
    return int(chosen[0]) if len(chosen) else None


def write_map_files(bundle: Bundle, window: Window, folder: Path) -> None:
    """map.yaml and map.pgm of the last version, map_1, map_2 ... of those before it."""
    versions = list(dict.fromkeys(h.version for h in reversed(_held(bundle, window))))[::-1]
    for number, version in enumerate(versions, start=1):
        grid = bundle.grid(version)
        assert grid is not None
        stem = "map" if number == len(versions) else f"map_{number}"
        for name, content in map_files(grid, stem).items():
            (folder / name).write_bytes(content)


def _held(bundle: Bundle, window: Window) -> tuple[Held, ...]:
    updates = bundle.table("map_updates")
    return map_course(updates, bundle.map_versions, window.start_ns, window.end_ns)
