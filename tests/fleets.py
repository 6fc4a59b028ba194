"""Rows of fleets that nobody drove, for the tests of what is made of them."""

from __future__ import annotations

from datetime import UTC, date, datetime

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


__all__ = ["DAY0", "HOUR", "date", "failed_row", "log_row", "place_row", "tables"]
