"""Rows of fleets that nobody drove, for the tests of what is made of them."""

from __future__ import annotations

from datetime import UTC, datetime

import pyarrow as pa

from slamreplay.fleet.schema import TABLES, arrow_schema

DAY0 = 1_767_225_600_000_000_000  # 2026-01-01, UTC
HOUR = 3_600_000_000_000


def log_row(key: str, **told) -> dict:
    """A healthy log of six minutes, 100 m driven, but for what is told otherwise."""
    start = told.get("start_ns", DAY0)
    day = datetime.fromtimestamp(start // 10**9, tz=UTC).date() if start > 10**18 else None
    row = {
        "key": key, "log": f"{key}.mcap", "content": f"c-{key}", "bytes": 1000, "status": "done",
        "site": "north", "robot": "r1", "software": "1.0", "map_version": "sha256:m",
        "day": day, "start_ns": start, "end_ns": start + HOUR // 10, "state": "healthy",
        "confidence": 0.95, "summary": "fine", "failure_mode": "none", "lost_s": 0.0,
        "lost_times": 0, "changed_s": 0.0, "judged_s": 360.0, "max_error_m": 0.1,
        "driven_m": 100.0, "stops": 0, "errors": 0, "warnings": 0, "report": f"logs/{key}",
        "slamreplay": "0.1.0",
    }  # fmt: skip
    return row | told


def failed_row(key: str, **told) -> dict:
    """A log that could not be judged."""
    row = dict.fromkeys(TABLES["logs"]) | {
        "key": key, "log": f"{key}.mcap", "content": f"c-{key}", "status": "failed",
        "error": "cut off", "site": "north", "robot": "r1",
    }  # fmt: skip
    return row | told


def place_row(key: str, col: int, row: int, **told) -> dict:
    """A place that was looked at and driven through, and found right."""
    found = {
        "key": key, "map_version": "sha256:m", "col": col, "row": row, "here_s": 8.0,
        "lost_s": 0.0, "entered_lost": 0, "seen_m2": 1.0, "contradicted_m2": 0.0,
    }  # fmt: skip
    return found | told


def tables(**rows: list[dict]) -> dict[str, pa.Table]:
    """Tables by name; columns that are not told are null."""
    return {
        name: pa.Table.from_pylist(
            [{column: row.get(column) for column in TABLES[name]} for row in found],
            schema=arrow_schema(name),
        )
        for name, found in rows.items()
    }


def random_fleet(seed: int, count: int, places: int = 40) -> dict[str, list[dict]]:
    """Rows of a fleet with everything that occurs: labels that lack, failures, copies, changes."""
    import numpy as np

    rng = np.random.default_rng(seed)
    kinds = ["kidnapped", "odometry_slip", "stale_map_use", "none"]
    states = ["healthy"] * 6 + ["lost", "lost_and_map_changed", "map_changed", "unobservable"]
    states.append("insufficient_data")
    rows: dict[str, list[dict]] = {name: [] for name in ("logs", "places", "regions", "findings")}
    for k in range(count):
        site = [None, "north", "south", "west"][int(rng.integers(0, 4))]
        robot = None if rng.random() < 0.1 else f"{site}-r{rng.integers(0, 4)}"
        software = None if rng.random() < 0.1 else f"1.{int(rng.integers(0, 3) + k // (count / 2))}"
        key = f"{rng.integers(0, 1 << 62):016x}"
        # Every tenth is a copy of one that is there already, some under the same name.
        copied = rows["logs"][int(rng.integers(0, k))] if k and rng.random() < 0.1 else None
        told = {
            "site": site, "robot": robot, "software": software,
            "content": copied["content"] if copied else None if rng.random() < 0.05 else f"c{k}",
            "log": copied["log"] if copied and rng.random() < 0.5 else f"{site}/{k}.mcap",
        }  # fmt: skip
        if rng.random() < 0.08:
            rows["logs"].append(failed_row(key, **told))
            continue
        state = states[int(rng.integers(0, len(states)))]
        lost, changed = "lost" in state, "changed" in state
        kind = kinds[int(rng.integers(0, 3))] if lost or changed else "none"
        version = f"sha256:{site}-{int(rng.integers(0, 2))}"
        start = 5 * 10**9 if rng.random() < 0.05 else DAY0 + int(rng.integers(0, 20 * 24)) * HOUR
        row = log_row(
            key, **told, start_ns=start, state=state, failure_mode=kind, map_version=version,
            root_cause=None if kind == "none" or rng.random() < 0.5 else "odometry_slip",
            lost_s=float(rng.integers(5, 300)) / 4 if lost else 0.0,
            lost_times=int(rng.integers(1, 4)) if lost else 0,
            changed_s=float(rng.integers(5, 300)) / 4 if changed else 0.0,
            judged_s=float(rng.integers(100, 4000)) / 4, driven_m=float(rng.integers(0, 900)) / 4,
            confidence=None if state in states[-2:] else float(rng.integers(50, 99)) / 100,
            stops=int(rng.integers(0, 3)) if rng.random() < 0.3 else 0,
            gate=[None, "passed", "failed", "skipped"][int(rng.integers(0, 4))],
        )  # fmt: skip
        rows["logs"].append(row)
        rows["findings"].append({"key": key, "id": "SR-DAT-002", "severity": "info"})
        for cell in np.unique(rng.integers(0, places, max(1, places // 2))).tolist():
            here = float(rng.integers(0, 60)) / 4
            was = here if lost and rng.random() < 0.3 else 0.0
            # Some corner of each map changes for good half way, others now and then.
            gone = cell < 4 and start > DAY0 + 10 * 24 * HOUR
            against = gone if cell < 4 else rng.random() < 0.05
            rows["places"].append(
                place_row(
                    key,
                    cell % 8 - 4,
                    cell // 8 - 2,
                    map_version=version,
                    here_s=here,
                    lost_s=was,
                    entered_lost=int(was > 0 and rng.random() < 0.5),
                    seen_m2=float(rng.integers(1, 1025)) / 1024,
                    contradicted_m2=float(rng.integers(52, 300)) / 1024 if against else 0.0,
                )
            )
            if against and rng.random() < 0.5:
                x, y = float(cell % 8 - 4), float(cell // 8 - 2)
                rows["regions"].append(
                    {
                        "key": key,
                        "map_version": version,
                        "x_min_m": x,
                        "y_min_m": y,
                        "x_max_m": x + 1.0,
                        "y_max_m": y + 0.5,
                        "area_m2": 0.5,
                        "kind": ["appeared", "removed", "moved"][int(rng.integers(0, 3))],
                    }
                )
    return rows


def commit_fleet(folder, rows: dict[str, list[dict]], parts: int = 7) -> None:
    """The rows in a folder, in several parts; some logs are committed twice, first as failed."""
    from slamreplay.fleet.store import commit

    keys = [row["key"] for row in rows["logs"]]
    commit(folder, tables(logs=[failed_row(key) for key in keys[:5]]))
    for k in range(parts):
        mine = set(keys[k::parts])
        commit(
            folder,
            tables(
                **{name: [r for r in found if r["key"] in mine] for name, found in rows.items()}
            ),
        )
