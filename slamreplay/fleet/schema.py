"""The tables of a fleet, as Parquet files that any reader of Parquet opens.

Every table has `key`, which says the log and how it was read: a key occurs once in `logs`. What
depends on how fast the machine was stands in `costs` alone, so that all others are the same bytes
for the same logs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa

#: Edge of a cell of `places`, m; cell (col, row) is [col, col + 1) x [row, row + 1) of it.
PLACE_M = 1.0

#: Sums of `places` are multiples of this (2^-10), s and m2: then sums over any number of logs, in
#: any order, are exact in float64, and the same in every program.
STEP = 1.0 / 1024.0

_KEY = {"key": ("string", "", "the log and how it was read")}
_SPAN = {
    "start_ns": ("int64", "ns", "on the clock of the log"),
    "end_ns": ("int64", "ns", "on the clock of the log"),
}
_MAP = {"map_version": ("string", "", "hash of the map whose frame it is in")}
_BOX = {
    "x_min_m": ("double", "m", "in the frame of the map"),
    "y_min_m": ("double", "m", "in the frame of the map"),
    "x_max_m": ("double", "m", "in the frame of the map"),
    "y_max_m": ("double", "m", "in the frame of the map"),
}

#: Columns by table: name -> (Arrow type, unit, what it is).
TABLES: dict[str, dict[str, tuple[str, str, str]]] = {
    "logs": {
        **_KEY,
        "log": ("string", "", "where it lies"),
        "content": ("string", "", "hash over its files: one log under two names has one"),
        "bytes": ("int64", "B", "of its files"),
        "status": ("string", "", "done or failed"),
        "error": ("string", "", "why it failed, in one line"),
        "site": ("string", "", "label"),
        "robot": ("string", "", "label"),
        "software": ("string", "", "label: version of the robot's software"),
        "map_version": ("string", "", "hash of the map it was judged against"),
        "day": ("date32", "", "of its start, UTC; null where its clock does not tell"),
        **_SPAN,
        "state": ("string", "", "of the verdict"),
        "confidence": ("double", "", "of the verdict"),
        "summary": ("string", "", "the verdict in one sentence"),
        "failure_mode": ("string", "", "how it began"),
        "root_cause": ("string", "", "what reproduces it; null where nothing does"),
        "lost_s": ("double", "s", "time the robot was lost"),
        "lost_times": ("int32", "", "how often it became lost"),
        "changed_s": ("double", "s", "time the map was changed"),
        "judged_s": ("double", "s", "time that could be judged"),
        "max_error_m": ("double", "m", "of the belief, greatest"),
        "driven_m": ("double", "m", "by hindsight"),
        "stops": ("int32", "", "unplanned ones"),
        "errors": ("int32", "", "findings of severity error"),
        "warnings": ("int32", "", "findings of severity warning"),
        "gate": ("string", "", "passed, failed or skipped; null without a recipe"),
        "report": ("string", "", "folder of its report, from the batch's folder"),
        "slamreplay": ("string", "", "the version that judged it"),
    },
    "findings": {
        **_KEY,
        "id": ("string", "", "as `slamreplay explain` knows it"),
        "severity": ("string", "", "info, warning or error"),
        "title": ("string", "", ""),
        "message": ("string", "", ""),
        **_SPAN,
        "value": ("double", "", "in `unit`"),
        "low": ("double", "", "of its interval"),
        "high": ("double", "", "of its interval"),
        "unit": ("string", "", ""),
        "n": ("int64", "", "samples"),
        "n_eff": ("double", "", "independent ones"),
    },
    "intervals": {
        **_KEY,
        "state": ("string", "", "as of a verdict"),
        **_SPAN,
        "confidence": ("double", "", ""),
        "max_error_m": ("double", "m", ""),
        "max_error_rad": ("double", "rad", ""),
    },
    "regions": {
        **_KEY,
        **_MAP,
        "kind": ("string", "", "appeared, removed or moved"),
        **_BOX,
        "area_m2": ("double", "m2", ""),
        "first_seen_ns": ("int64", "ns", "on the clock of the log"),
        "last_seen_ns": ("int64", "ns", "on the clock of the log"),
        "views": ("int64", "", "scans that saw it"),
        "confidence": ("double", "", ""),
    },
    "stops": {
        **_KEY,
        **_MAP,
        "t_ns": ("int64", "ns", "on the clock of the log"),
        "x_m": ("double", "m", "in the frame of the map"),
        "y_m": ("double", "m", "in the frame of the map"),
        "state": ("string", "", "then"),
        "cause": ("string", "", "the first one"),
    },
    "places": {
        **_KEY,
        **_MAP,
        "col": ("int32", "", "x from col to col + 1 edges of a place, in the frame of the map"),
        "row": ("int32", "", "y likewise"),
        "here_s": ("double", "s", "time the robot was there, by hindsight"),
        "lost_s": ("double", "s", "of it, time it was lost"),
        "entered_lost": ("int32", "", "times it became lost here"),
        "seen_m2": ("double", "m2", "of the map here that beams checked"),
        "contradicted_m2": ("double", "m2", "of it, what they contradicted last"),
    },
    "costs": {
        **_KEY,
        "cpu_s": ("double", "s", "of the process that judged it"),
        "wall_s": ("double", "s", ""),
        "peak_mb": ("double", "MB", "resident memory of that process so far, greatest"),
        "attempts": ("int32", "", "how often it was begun, as far as known"),
    },
}


def arrow_schema(table: str) -> pa.Schema:
    """The Arrow schema of a table, with `unit` and `doc` in the metadata of each column."""
    import pyarrow as pa

    types = {"string": pa.string(), "double": pa.float64(), "date32": pa.date32(),
             "int32": pa.int32(), "int64": pa.int64()}  # fmt: skip
    return pa.schema(
        [
            pa.field(name, types[kind], metadata={"unit": unit, "doc": doc})
            for name, (kind, unit, doc) in TABLES[table].items()
        ]
    )
