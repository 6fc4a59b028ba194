"""Fleets made up from a seed: tables as a batch leaves them, and maps, with truths to find again.

In the first site a box stands in one aisle from `AGED_DAY` on and robots get lost beside it; the
second was mapped anew on `MAPPED_DAY`; in the third `NEW_SOFTWARE` came with `SOFTWARE_DAY` and
loses its robots `WORSE` times as often. One log lies twice in the store, two could not be read,
one has neither labels nor a date.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa

from slamreplay.fleet.schema import TABLES, arrow_schema
from slamreplay.fleet.store import commit
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import map_files

S = 10**9
FIRST_DAY = date(2026, 3, 2)
AGED_DAY, MAPPED_DAY, SOFTWARE_DAY = 4, 5, 6
AGED_AISLE, BOX_ROWS, AISLE_ROWS = 3, (7, 11), (3, 17)
OLD_SOFTWARE, NEW_SOFTWARE, WORSE = "2.3.1", "2.4.0", 4.0
NAMES = ("north", "south", "west")
AISLES, AISLE_M, RESOLUTION_M = 6, 6.0, 0.1
#: States by how a log went: lost, changed.
_STATES = np.array([["healthy", "map_changed"], ["lost", "lost_and_map_changed"]])
_MODES = np.array(["odometry_slip", "sensing_ambiguity", "kidnapped", "wrong_initial_pose"])
_CAUSES = np.array(["the wheels slipped", "the aisles look alike", "it was carried away", ""])


@dataclass(frozen=True, eq=False)
class Fleet:
    """Tables by name, and maps by version."""

    tables: dict[str, pa.Table]
    maps: dict[str, OccupancyGrid] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """As a batch leaves them, a part for each half of the logs."""
        keys = self.tables["logs"]["key"].to_numpy(zero_copy_only=False).astype(str)
        half = keys[len(keys) // 2]
        for is_first in (True, False):
            part = {}
            for name, one in self.tables.items():
                rows = one["key"].to_numpy(zero_copy_only=False).astype(str) < half
                part[name] = one.filter(pa.array(rows == is_first))
            commit(folder, part)
        for version, grid in self.maps.items():
            target = folder / "maps" / version.removeprefix("sha256:")[:16]
            target.mkdir(parents=True, exist_ok=True)
            for name, data in map_files(grid, "map").items():
                (target / name).write_bytes(data)
        (folder / "batch.json").write_text(json.dumps({"schema_version": 1}))
        return folder


def fleet(
    seed: int = 0, *, sites: int = 3, robots: int = 12, days: int = 10, logs_a_day: int = 24
) -> Fleet:
    """A fleet of so many robots, spread over the sites; each log is of about ten minutes."""
    rng = np.random.default_rng(seed)
    n = days * logs_a_day
    site, day = rng.integers(sites, size=n), np.sort(rng.integers(days, size=n))
    site[:sites] = np.arange(sites)
    robot = site + sites * rng.integers(max(robots // sites, 1), size=n)
    newer = day >= SOFTWARE_DAY
    maps = [site_grid(k) for k in range(sites)] + [site_grid(1, moved_m=1.0)]
    map_of = np.where((site == 1) & (day >= MAPPED_DAY), sites, site)
    visited = rng.random((n, AISLES)) < 0.55
    visited[np.arange(n), rng.integers(AISLES, size=n)] = True
    aged = (site == 0) & (day >= AGED_DAY) & visited[:, AGED_AISLE]
    changed = aged & (rng.random(n) < 0.85)
    p_lost = np.where((site % 3 == 2) & newer, 0.1 * WORSE, 0.1) + np.where(changed, 0.8, 0.0)
    lost = rng.random(n) < p_lost
    where = np.argmax(visited * rng.random((n, AISLES)), axis=1)
    where = np.where(lost & changed, AGED_AISLE, where)
    start_ns = (
        np.array([_ns(int(d)) for d in range(days)])[day] + rng.integers(16 * 3600, size=n) * S
    )
    keys = np.array([f"{k:032x}" for k in range(n)])
    names = [NAMES[k] if k < 3 else f"site-{k:02d}" for k in range(sites)]
    places, times = _places(rng, keys, visited, lost, where, changed, _BOX_OF)
    logs = {
        "key": keys,
        "log": [f"{names[s]}/{FIRST_DAY + timedelta(int(d))}/run_{k:06d}.mcap"
                for k, (s, d) in enumerate(zip(site, day, strict=True))],
        "content": [f"{k:064x}" for k in range(n)],
        "bytes": rng.integers(20, 90, size=n) * 10**6,
        "status": ["done"] * n,
        "error": [None] * n,
        "site": np.array(names)[site],
        "robot": [f"{names[s][0]}{names[s][-2:] if s > 2 else ''}{r // sites + 1}"
                  for s, r in zip(site, robot, strict=True)],
        "software": np.where(newer, NEW_SOFTWARE, OLD_SOFTWARE),
        "map_version": np.array([one.version for one in maps])[map_of],
        "day": [FIRST_DAY + timedelta(int(d)) for d in day],
        "start_ns": start_ns,
        "end_ns": start_ns + (times["here"] * S).astype(np.int64),
        "state": _STATES[lost.astype(int), changed.astype(int)],
        "confidence": rng.uniform(0.7, 0.98, size=n),
        "summary": np.where(lost, "The robot was lost.", "The robot knew where it was."),
        "failure_mode": np.where(
            lost, np.where(changed, "stale_map_use", _MODES[robot % 4]), "none"
        ),
        "root_cause": [None] * n,
        "lost_s": times["lost"],
        "lost_times": lost.astype(int),
        "changed_s": np.where(changed, 40.0, 0.0),
        "judged_s": times["here"],
        "max_error_m": np.where(lost, rng.uniform(0.8, 6.0, size=n), rng.uniform(0.02, 0.2, n)),
        "driven_m": times["here"] * 0.6,
        "stops": rng.poisson(np.where(lost, 2.0, 0.1)),
        "errors": lost.astype(int) + changed,
        "warnings": rng.poisson(0.5, size=n),
        "gate": np.where(lost, "failed", "passed"),
        "report": [f"logs/run_{k:06d}-{key[:8]}" for k, key in enumerate(keys)],
        "slamreplay": ["0.1.0"] * n,
    }  # fmt: skip
    logs = {name: np.asarray(values, dtype=object).tolist() for name, values in logs.items()}
    logs["root_cause"] = [
        str(_CAUSES[r % 4]) or None if is_lost and not is_changed else None
        for r, is_lost, is_changed in zip(robot, lost, changed, strict=True)
    ]
    odd = _odd_ones(logs, np.flatnonzero(~lost & ~changed))
    tables = {
        "logs": logs,
        "intervals": _intervals(rng, logs, lost, changed),
        "findings": _findings(logs, lost, changed),
        "regions": _with_map(logs, _regions(rng, logs, np.flatnonzero(changed))),
        "stops": _with_map(logs, _stops(rng, logs, where)),
        "places": _with_map(logs, places),
        "costs": {"key": logs["key"], "cpu_s": [7.0] * n, "wall_s": [7.5] * n,
                  "peak_mb": [600.0] * n, "attempts": [1] * n},
    }  # fmt: skip
    made = {name: _arrow(name, columns, dropped=odd) for name, columns in tables.items()}
    used = {one.version: one for k, one in enumerate(maps) if k in set(map_of.tolist())}
    return Fleet(made, used)


def site_grid(site: int, *, moved_m: float = 0.0) -> OccupancyGrid:
    """A hall of 36 x 20 m: racks of 2 m between aisles of 4 m, shifted by so much along them."""
    height, width = round(20 / RESOLUTION_M), round(AISLES * AISLE_M / RESOLUTION_M)
    cells = np.zeros((height, width), dtype=np.int8)
    for edge in (np.s_[:2], np.s_[-2:], np.s_[:, :2], np.s_[:, -2:]):
        cells[edge] = 100
    low, high = (round((row + moved_m) / RESOLUTION_M) for row in AISLE_ROWS)
    for rack in range(1, AISLES):
        x = round((rack * AISLE_M - 1.0) / RESOLUTION_M)
        cells[low:high, x : x + round(2.0 / RESOLUTION_M)] = 100
    cells[: 5 + site, : 5 + site] = -1  # no two sites have one map
    return OccupancyGrid(cells, RESOLUTION_M, np.array([0.0, 0.0, 0.0]))


#: Columns of places of the box that ages the map, of the aisle's four.
_BOX_OF = (1, 3)


def _ns(day: int) -> int:
    at = datetime(FIRST_DAY.year, FIRST_DAY.month, FIRST_DAY.day, 5, tzinfo=UTC)
    return int((at + timedelta(days=day)).timestamp()) * S


def _places(rng, keys, visited, lost, where, changed, box):
    """Rows of places, and time here and lost of each log (N,)."""
    log, aisle = np.nonzero(visited)
    rows = np.arange(*AISLE_ROWS)
    log, aisle = np.repeat(log, 2 * len(rows)), np.repeat(aisle, 2 * len(rows))
    row = np.tile(np.repeat(rows, 2), visited.sum())
    side = np.tile([1, 2], len(row) // 2)
    col = (aisle * AISLE_M + 1 + side).astype(int)
    here = rng.gamma(4.0, 0.8, size=len(row))
    begins = rng.integers(AISLE_ROWS[0], 10, size=len(keys))
    is_lost = lost[log] & (where[log] == aisle) & (row >= begins[log])
    in_box = (
        changed[log] & (aisle == AGED_AISLE) & (row >= BOX_ROWS[0]) & (row < BOX_ROWS[1])
        & (side >= box[0]) & (side < box[1])
    )  # fmt: skip
    seen = rng.uniform(0.5, 1.0, size=len(row))
    columns = {
        "key": keys[log],
        "col": col,
        "row": row,
        "here_s": here,
        "lost_s": np.where(is_lost, here, 0.0),
        "entered_lost": (is_lost & (row == begins[log]) & (side == 1)).astype(int),
        "seen_m2": seen,
        "contradicted_m2": np.where(
            in_box, 0.7 * seen, np.where(rng.random(len(row)) < 0.01, 0.02, 0)
        ),
    }
    times = {
        "here": np.bincount(log, here, minlength=len(keys)),
        "lost": np.bincount(log, np.where(is_lost, here, 0.0), minlength=len(keys)),
    }
    return columns, times


def _odd_ones(logs, calm):
    """Two logs that failed, one that lies there twice, one that nothing is known of.

    Returns the keys of the failed ones.
    """
    for k, line in zip(calm[:2], ("no scan and no pose in it", "the file ends early"), strict=True):
        keep = ("key", "log", "content", "bytes", "site", "robot", "software", "slamreplay")
        for name in logs:
            if name not in keep:
                logs[name][k] = None
        logs["status"][k], logs["error"][k] = "failed", f"{logs['log'][k]}: {line}"
    logs["content"][calm[3]] = logs["content"][calm[2]]
    for name in ("site", "robot", "software", "day", "map_version"):
        logs[name][calm[4]] = None
    return {logs["key"][k] for k in calm[:2]}


def _intervals(rng, logs, lost, changed):
    """A healthy stretch, and a worse one at the end of logs that have one."""
    out = {name: [] for name in TABLES["intervals"]}
    for k, state in enumerate(logs["state"]):
        if logs["status"][k] == "failed":
            continue
        start, end = logs["start_ns"][k], logs["end_ns"][k]
        turn = int(start + 0.6 * (end - start)) if lost[k] or changed[k] else end
        for one, a, b in (("healthy", start, turn), (str(state), turn, end)):
            if b > a:
                row = (logs["key"][k], one, a, b, 0.9, logs["max_error_m"][k], 0.05)
                for name, value in zip(out, row, strict=True):
                    out[name].append(value)
    return out


def _findings(logs, lost, changed):
    out = {name: [] for name in TABLES["findings"]}
    for k in range(len(logs["key"])):
        for is_there, one, title in (
            (lost[k], "SR-LOC-001", "Robot lost"), (changed[k], "SR-MAP-001", "Map changed")
        ):  # fmt: skip
            if is_there:
                row = (logs["key"][k], one, "error", title, f"{title} in this log.",
                       logs["start_ns"][k], logs["end_ns"][k],
                       1.2, 1.0, 1.4, "m", 40, 12.0)  # fmt: skip
                for name, value in zip(out, row, strict=True):
                    out[name].append(value)
    return out


def _regions(rng, logs, which):
    """The box as each log saw it: a little shifted each time."""
    n, x = len(which), AGED_AISLE * AISLE_M + 1 + _BOX_OF[0]
    shift = rng.normal(0.0, 0.08, size=(n, 2))
    return {
        "key": [logs["key"][k] for k in which],
        "kind": ["appeared"] * n,
        "x_min_m": x + shift[:, 0], "y_min_m": BOX_ROWS[0] + shift[:, 1],
        "x_max_m": x + 2.0 + shift[:, 0], "y_max_m": BOX_ROWS[1] + shift[:, 1],
        "area_m2": rng.uniform(4.0, 7.0, size=n),
        "first_seen_ns": [logs["start_ns"][k] for k in which],
        "last_seen_ns": [logs["end_ns"][k] for k in which],
        "views": rng.integers(40, 400, size=n),
        "confidence": rng.uniform(0.8, 0.99, size=n),
    }  # fmt: skip


def _stops(rng, logs, where):
    out = {name: [] for name in TABLES["stops"] if name != "map_version"}
    for k, count in enumerate(logs["stops"]):
        for _ in range(count or 0):
            row = (logs["key"][k], logs["end_ns"][k] - int(rng.integers(60)) * S,
                   float(where[k] * AISLE_M + 3), float(rng.uniform(*AISLE_ROWS)),
                   str(logs["state"][k]), "a localizer that was lost")  # fmt: skip
            for name, value in zip(out, row, strict=True):
                out[name].append(value)
    return out


def _with_map(logs, columns):
    """The columns of rows with that of their log's map."""
    versions = dict(zip(logs["key"], logs["map_version"], strict=True))
    return {**columns, "map_version": [versions[key] for key in columns["key"]]}


def _arrow(name, columns, *, dropped):
    """The columns as their table has them; a failed log has rows in `logs` and `costs` alone."""
    schema = arrow_schema(name)
    made = pa.table(
        {c: pa.array(columns[c], schema.field(c).type) for c in schema.names}, schema=schema
    )
    if name in ("logs", "costs"):
        return made
    keep = [key not in dropped for key in columns["key"]]
    return made.filter(pa.array(keep, pa.bool_()))
