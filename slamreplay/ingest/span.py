"""From when to when a bundle goes, and how much of the log is asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Clock, Frames, Loss
from slamreplay.errors import LogError, UsageError
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.ingest.assembly import Assembly

#: Tables whose latest row before the start still holds after it.
_HOLDING = ("transforms", "poses", "initial_poses")


def evidence_span(
    tables: Mapping[str, Assembly], frames: Frames, log: Path, losses: Sequence[Loss]
) -> tuple[int, int]:
    """First and last time of the evidence; a latched message of the day before does not count.

    Raises:
        LogError: no scan, no odometry, and no pose beside a reference: nothing to work with.
    """
    times = [tables[name].t_ns for name in ("scans", "odometry") if _rows(tables, name)]
    moving = _moving(tables, frames)
    if len(moving) and not _rows(tables, "odometry"):
        times.append(moving)
    if not times and _rows(tables, "poses") and _rows(tables, "references"):
        times = [tables["poses"].t_ns, tables["references"].t_ns]
    if not times:
        broken = next((loss.reason for loss in losses if loss.kind == "lost"), None)
        if broken is not None:
            raise LogError(f"no scan and no odometry could be read: {broken}", where=log)
        raise LogError(
            "no scan and no odometry in it: nothing to work with",
            where=log,
            hint="a LaserScan, an Odometry or odom -> base on tf is needed",
        )
    return int(min(t.min() for t in times)), int(max(t.max() for t in times))


def cut(
    tables: Mapping[str, Assembly],
    span: tuple[int, int],
    start_s: float | None,
    end_s: float | None,
) -> tuple[dict[str, Assembly], tuple[int, int]]:
    """Tables and span between two times, given in seconds after the span's start.

    Of what holds until it is replaced (static transforms, the localizer's last word) the latest row
    before the start is kept; of map versions every row, for not every version has its map; of a
    costmap with windows the last whole grid and the windows since.

    Raises:
        UsageError: nothing lies between.
    """
    if start_s is None and end_s is None:
        return dict(tables), span
    start = span[0] + ns(start_s or 0.0)
    end = span[1] if end_s is None else min(span[1], span[0] + ns(end_s))
    if not start < end:
        length_s = (span[1] - span[0]) / NS_PER_S
        raise UsageError(
            f"nothing is left between --start {start_s or 0:g} and "
            f"--end {length_s if end_s is None else end_s:g}",
            hint=f"the log lasts {length_s:.1f} s",
        )
    parts = {name: _part(table, start, end) for name, table in tables.items()}
    return parts | _costmaps_part(tables, start, end), (start, end)


def clock_between(clock: Clock, tables: Mapping[str, Assembly]) -> Clock:
    """The clock with the knots that the tables need, so that a part's manifest stays small."""
    log = [t["t_log_ns"] for t in tables.values() if len(t)]
    if not log or not clock.knots:
        return clock
    low, high = min(t.min() for t in log), max(t.max() for t in log)
    inside = [i for i, knot in enumerate(clock.knots) if low <= knot[0] <= high]
    first, last = (inside[0], inside[-1]) if inside else (0, len(clock.knots) - 1)
    knots = clock.knots[max(first - 1, 0) : last + 2]
    return clock.model_copy(update={"knots": knots})


def _part(table: Assembly, start: int, end: int) -> Assembly:
    t = table.t_ns
    keep = (t >= start) & (t <= end)
    if table.schema.name == "transforms":
        keep |= table["is_static"]
    if table.schema.name == "map_updates":
        keep |= t < start
    if table.schema.name in _HOLDING:
        keep[_latest_before(table, start)] = True
    return table.take(keep)


def _costmaps_part(tables: Mapping[str, Assembly], start: int, end: int) -> dict[str, Assembly]:
    """Whole grids and windows of the costmaps that have windows before the start."""
    if not (_rows(tables, "costmaps") and _rows(tables, "costmap_updates")):
        return {}
    grids, windows = tables["costmaps"], tables["costmap_updates"]
    keep = [(t.t_ns >= start) & (t.t_ns <= end) for t in (grids, windows)]
    for row in _latest_before(grids, start).tolist():
        own = windows["grid_topic"] == grids["topic"][row]
        if own.any():
            keep[0][row] = True
            keep[1] |= own & (windows.t_ns >= grids.t_ns[row]) & (windows.t_ns <= end)
    return {"costmaps": grids.take(keep[0]), "costmap_updates": windows.take(keep[1])}


def _latest_before(table: Assembly, start: int) -> NDArray[np.int64]:
    """The last row before `start` of each topic, or of each edge."""
    before = np.flatnonzero(table.t_ns < start)
    names = [table["topic"].astype(str)]
    if table.schema.name == "transforms":
        names += [table["parent_frame"].astype(str), table["child_frame"].astype(str)]
    latest: dict[tuple[str, ...], int] = {}
    for row, *key in zip(before, *(n[before] for n in names), strict=True):
        latest[tuple(key)] = int(row)
    return np.array(sorted(latest.values()), dtype=np.int64)


def _moving(tables: Mapping[str, Assembly], frames: Frames) -> NDArray[np.int64]:
    """Times of the tf edges that carry the base in odom (or what is posed, without an odom)."""
    table = tables.get("transforms")
    if table is None or frames.base is None or frames.odom is None:
        return np.empty(0, dtype=np.int64)
    rows = (table["child_frame"] == frames.base) & (table["parent_frame"] == frames.odom)
    return np.asarray(table.t_ns[rows & ~table["is_static"]])


def _rows(tables: Mapping[str, Assembly], name: str) -> bool:
    return name in tables and len(tables[name]) > 0
