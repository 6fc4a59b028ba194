"""How long a fleet's tables take with a hundred thousand logs, and how much memory.

    python tests/benchmarks/fleet_scale.py FOLDER [LOGS] [PLACES]

writes LOGS (100000) logs of 100 sites with PLACES (150) places each into FOLDER, 500 at a time, and
asks everything of them. Every number is of one process; memory is the greatest so far.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa

from slamreplay.fleet.answering import answers
from slamreplay.fleet.parts import parts_in
from slamreplay.fleet.schema import arrow_schema
from slamreplay.fleet.store import commit, committed, compact, read

DAY0 = 1_767_225_600_000_000_000
DAY_NS = 86_400_000_000_000
SITES, WIDE, HIGH = 100, 60, 40


def timed(what: str, act: Callable[[], object]) -> object:
    """Run it and say what it took."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = act()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    print(f"{what:<28} {wall:8.2f} s wall {cpu:8.2f} s cpu {peak:8.0f} MB", flush=True)
    return found


def table(name: str, rows: int, columns: dict[str, object]) -> pa.Table:
    """A table of the schema; columns that are not told are null."""
    schema = arrow_schema(name)
    return pa.table(
        [
            pa.array(columns[f.name], type=f.type) if f.name in columns else pa.nulls(rows, f.type)
            for f in schema
        ],
        schema=schema,
    )


def block(first: int, count: int, places: int) -> dict[str, pa.Table]:
    """Logs `first` to `first + count` and their places."""
    rng = np.random.default_rng(first)
    site = rng.integers(0, SITES, count)
    robot = rng.integers(0, 20, count)
    start = DAY0 + rng.integers(0, 30, count) * DAY_NS + rng.integers(0, DAY_NS, count)
    lost, changed = rng.random(count) < 0.05, rng.random(count) < 0.1
    state = np.select(
        [lost & changed, lost, changed], ["lost_and_map_changed", "lost", "map_changed"], "healthy"
    )
    key = [f"{k:032x}" for k in range(first, first + count)]
    logs = table(
        "logs",
        count,
        {
            "key": key,
            "log": [f"s3://logs/site-{s}/{k}.mcap" for s, k in zip(site, key, strict=True)],
            "content": [f"sha256:{k}" for k in key],
            "bytes": np.full(count, 40_000_000),
            "status": ["done"] * count,
            "site": [f"site-{s}" for s in site],
            "robot": [f"site-{s}-r{r}" for s, r in zip(site, robot, strict=True)],
            "software": [f"2.{k}" for k in (start - DAY0) // (10 * DAY_NS)],
            "map_version": [f"sha256:{s:064x}" for s in site],
            "day": (start // DAY_NS).astype("datetime64[D]"),
            "start_ns": start,
            "end_ns": start + 600 * 10**9,
            "state": state.tolist(),
            "confidence": rng.uniform(0.6, 1.0, count),
            "summary": ["The robot knew where it was and the map was right."] * count,
            "failure_mode": np.where(lost, "kidnapped", np.where(changed, "stale_map_use", "none")),
            "lost_s": np.where(lost, rng.uniform(5, 90, count), 0.0),
            "lost_times": lost.astype(np.int32),
            "changed_s": np.where(changed, rng.uniform(5, 90, count), 0.0),
            "judged_s": np.full(count, 600.0),
            "driven_m": rng.uniform(50, 400, count),
            "stops": rng.integers(0, 2, count),
            "report": [f"logs/{k}" for k in key],
            "slamreplay": ["0.1.0"] * count,
        },
    )
    rows = count * places
    log = np.repeat(np.arange(count), places)
    # A run of neighbouring places from anywhere on.
    cell = np.repeat(rng.integers(0, WIDE * HIGH, count), places) + np.tile(
        np.arange(places), count
    )
    cell %= WIDE * HIGH
    here = np.rint(rng.exponential(2.0, rows) * 1024) / 1024 * (rng.random(rows) < 0.3)
    was = here * lost[log] * (rng.random(rows) < 0.2)
    gone = (cell // 7 % 97 == site[log] % 97) & (start[log] > DAY0 + 15 * DAY_NS)
    against = gone | (rng.random(rows) < 0.0005)
    column = {
        "key": pa.array(key).take(pa.array(log)),
        "map_version": logs["map_version"].combine_chunks().take(pa.array(log)),
        "col": cell % WIDE,
        "row": cell // WIDE,
        "here_s": here,
        "lost_s": was,
        "entered_lost": ((was > 0) & (rng.random(rows) < 0.1)).astype(np.int32),
        "seen_m2": np.rint(rng.uniform(0.1, 1.0, rows) * 1024) / 1024,
        "contradicted_m2": np.where(against, 0.25, 0.0),
    }
    return {"logs": logs, "places": table("places", rows, column)}


def main(folder: Path, count: int, places: int) -> None:
    """Write and ask."""
    block(0, 2, places)

    def write() -> None:
        for first in range(len(committed(folder)), count, 500):
            commit(folder, block(first, min(500, count - first), places))

    timed(f"commit {count} logs", write)
    print(f"parts: {len(parts_in(folder))}")
    timed("committed", lambda: committed(folder))
    timed("read logs", lambda: read(folder, "logs"))
    found = timed("answers", lambda: answers(folder))
    print(f"{len(found.areas)} areas, {len(found.spots)} spots, {found.total.logs} logs")
    timed("compact", lambda: compact(folder))
    size = sum(f.stat().st_size for f in (folder / "tables").rglob("*.parquet"))
    print(f"parts: {len(parts_in(folder))}, {size / 1e6:.0f} MB on disk")
    timed("committed", lambda: committed(folder))


if __name__ == "__main__":
    main(
        Path(sys.argv[1]),
        *(int(n) for n in (sys.argv[2:] + ["100000", "150"][len(sys.argv) - 2 :])),
    )
