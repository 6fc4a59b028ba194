"""The versions of a map that a log holds: whole grids and windows of them, one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import MapError
from slamreplay.ingest.grid_updates import fitting
from slamreplay.ingest.rows import TopicRows
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.versions import changed_cells

#: A mapping run publishes its map every few seconds for hours: so many versions are kept, chosen so
#: that each of the others differs as little as can be from the kept one before it.
MAX_VERSIONS = 20


@dataclass(frozen=True, eq=False)
class RecordedMaps:
    """What a map topic and its windows told.

    Attributes:
        grids: the versions that were kept, in the order in which they held last.
        updates: rows of table `map_updates`, of the whole grids and of the windows.
        losses: what made no sense, and how many versions were not kept.
    """

    grids: list[OccupancyGrid]
    updates: list[TopicRows]
    losses: list[Loss]


def recorded_maps(grids: TopicRows, windows: TopicRows | None = None) -> RecordedMaps:
    """Every version of a map, from whole grids and windows in the order of log time.

    Only one grid and the kept ones are in memory at a time, so the rows are gone through twice.
    """
    losses: list[Loss] = []
    if windows is not None:
        windows, losses = fitting(grids, windows)
    count = len(grids) + (0 if windows is None else len(windows))
    versions, cost = np.full(count, "", dtype=object), np.zeros(count, dtype=np.int64)
    odd: list[str] = []
    before: OccupancyGrid | None = None
    for row, grid in _course(grids, windows, odd):
        if before is None or grid.version != before.version:
            cost[row] = 0 if before is None else changed_cells(before, grid)
            before = grid
        versions[row] = grid.version
    order = _order(grids, windows)
    kept = _kept(versions[order], np.cumsum(cost[order]))
    found: dict[str, OccupancyGrid] = {}
    for row, grid in _course(grids, windows, []):
        if versions[row] in kept.versions:
            found.pop(versions[row], None)  # a version that comes back is the newest again
            found[versions[row]] = grid
    if odd:
        losses.append(Loss(kind="lost", what=grids.topic, count=len(odd), reason=odd[0]))
    if kept.left_out:
        reason = (
            f"map versions beyond {MAX_VERSIONS}: the kept one before stands in, which differs by "
            f"{kept.apart_cells} cells at most"
        )
        loss = Loss(kind="skipped", what=grids.topic, count=kept.left_out, reason=reason)
        losses.append(loss)
    parts = [_rows(grids, versions[: len(grids)])]
    if windows is not None:
        parts.append(_rows(windows, versions[len(grids) :]))
    return RecordedMaps(list(found.values()), parts, losses)


@dataclass(frozen=True)
class _Kept:
    versions: frozenset[str]
    left_out: int
    apart_cells: int


def _kept(versions: NDArray[np.object_], course: NDArray[np.int64]) -> _Kept:
    """Which versions to keep of rows in the order of time, given the cells changed up to each.

    The least tolerance is looked for such that keeping a version whenever more cells than that
    have changed since the last kept one keeps no more than `MAX_VERSIONS`.
    """
    held = versions != ""
    versions, course = versions[held], course[held]
    distinct = set(versions.tolist())
    if len(distinct) <= MAX_VERSIONS:
        return _Kept(frozenset(distinct), 0, 0)

    def choose(tolerance: int) -> frozenset[str]:
        chosen, last = [0], int(course[0])
        while True:
            row = int(np.searchsorted(course, last + tolerance, side="right"))
            if row >= len(course):
                return frozenset(versions[[*chosen, -1]].tolist())
            chosen.append(row)
            last = int(course[row])

    low, high = 0, int(course[-1] - course[0])
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if len(choose(middle)) <= MAX_VERSIONS else (middle + 1, high)
    chosen = choose(low)
    return _Kept(chosen, len(distinct - chosen), low)


def _order(grids: TopicRows, windows: TopicRows | None) -> NDArray[np.int64]:
    """Rows of both, numbered on, by log time; of one moment the whole grid comes first."""
    t_log_ns = grids.t_log_ns
    if windows is not None:
        t_log_ns = np.concatenate([t_log_ns, windows.t_log_ns])
    return np.argsort(t_log_ns, kind="stable")


def _course(
    grids: TopicRows, windows: TopicRows | None, odd: list[str]
) -> Iterator[tuple[int, OccupancyGrid]]:
    """Each row in the order of time, and the map that it makes; why it makes none goes to `odd`."""
    now: OccupancyGrid | None = None
    for row in _order(grids, windows).tolist():
        try:
            if row < len(grids):
                now = None
                now = _whole(grids, row)
            elif windows is not None and now is not None:
                now = _patched(now, windows, row - len(grids))
        except MapError as error:
            odd.append(str(error))
        if now is not None:
            yield row, now


def _whole(grids: TopicRows, row: int) -> OccupancyGrid:
    height, width = grids.columns["height"][row], grids.columns["width"][row]
    # ROS sends the resolution as float32: 0.05 arrives as 0.0500000007.
    resolution = float(str(np.float32(grids.columns["resolution_m"][row])))
    cells = grids.columns["cells"][row].reshape(height, width)
    origin = np.array(grids.columns["origin_xyyaw"][row])
    return OccupancyGrid(cells.copy(), resolution, origin, grids.columns["frame_id"][row])


def _patched(grid: OccupancyGrid, windows: TopicRows, row: int) -> OccupancyGrid:
    x, y, width, height = (int(windows.columns[c][row]) for c in ("x", "y", "width", "height"))
    cells = grid.cells.copy()
    cells[y : y + height, x : x + width] = windows.columns["cells"][row].reshape(height, width)
    return OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)


def _rows(topic: TopicRows, versions: NDArray[np.object_]) -> TopicRows:
    """Rows of table `map_updates`; messages that made no map have none."""
    index = np.flatnonzero(versions != "")
    rows = topic.take(index)
    columns = {"map_version": versions[index], "frame_id": rows.columns["frame_id"]}
    return TopicRows(
        rows.topic, rows.type, rows.messages, "map_updates", columns, rows.t_sensor_ns,
        rows.t_log_ns,
    )  # fmt: skip
