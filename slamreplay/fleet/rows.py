"""One post-mortem as rows of all tables: the same post-mortem gives the same rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, date, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.evidence.clean import clean
from slamreplay.evidence.result import Postmortem
from slamreplay.fleet.places import became_lost, places_of
from slamreplay.fleet.schema import TABLES, arrow_schema
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report.model import Report
from slamreplay.verdict.judgement import Interval
from slamreplay.version import __version__

if TYPE_CHECKING:
    import pyarrow as pa

#: Clocks that tell another time than these years tell none of the wall: simulated time, uptime.
_FIRST, _LAST = datetime(2000, 1, 1, tzinfo=UTC), datetime(2100, 1, 1, tzinfo=UTC)
#: Slower than this over a second is no driving: hindsight trembles by a scan's noise.
_DRIVES_M_S = 0.05
#: Faster is none either: the robot was carried, or hindsight begins anew in another map.
_CARRIED_M_S = 10.0
#: States that tell nothing of the robot.
UNJUDGED = ("insufficient_data", "unobservable")


def rows_of(
    post: Postmortem,
    report: Report,
    *,
    key: str,
    log: str,
    content: str | None,
    bytes: int | None,  # noqa: A002 - as the column
    labels: Mapping[str, str],
    gate: str | None,
    report_folder: str | None,
) -> dict[str, pa.Table]:
    """The rows of all tables but `costs`.

    Args:
        post: the post-mortem.
        report: made of it.
        key: of the log and how it was read.
        log: where it lies.
        content: hash over its files.
        bytes: of its files.
        labels: site, robot and software, as far as they are known.
        gate: how the gate judged it; None without a gate.
        report_folder: of its report, from the batch's folder.
    """
    start_ns = report.bundle.start_ns
    intervals = post.judgement.intervals
    errors = [i.max_error_m for i in report.intervals if i.max_error_m is not None]
    severities = [finding.severity for finding in report.findings]
    row = {
        **_log(key, log, content, bytes, labels),
        "status": "done",
        "map_version": report.bundle.map_version,
        "day": day_of(start_ns),
        "start_ns": start_ns,
        "end_ns": report.bundle.end_ns,
        "state": report.verdict.state,
        "confidence": report.verdict.confidence,
        "summary": report.verdict.summary,
        "failure_mode": report.failure_mode.kind,
        "root_cause": _root_cause(report),
        "lost_s": _seconds(i for i in intervals if i.is_lost),
        "lost_times": len(became_lost(post)),
        "changed_s": _seconds(i for i in intervals if i.is_changed),
        "judged_s": _seconds(i for i in intervals if i.state not in UNJUDGED),
        "max_error_m": max(errors, default=None),
        "driven_m": driven_m(post),
        "stops": len(report.stops),
        "errors": severities.count("error"),
        "warnings": severities.count("warning"),
        "gate": gate,
        "report": None if report_folder is None else clean(report_folder),
    }
    regions = [
        {**region.model_dump(), **dict(zip(_BOX, region.bbox_m, strict=True))}
        for region in report.changed_regions
    ]
    stops = [
        {**stop.model_dump(), "map_version": _map_at(post, stop.t_ns)} for stop in report.stops
    ]
    return {
        "logs": _table("logs", key, [row]),
        "findings": _table("findings", key, [part.model_dump() for part in report.findings]),
        "intervals": _table("intervals", key, [part.model_dump() for part in report.intervals]),
        "regions": _table("regions", key, regions),
        "stops": _table("stops", key, stops),
        "places": _places(key, post),
    }


_BOX = ("x_min_m", "y_min_m", "x_max_m", "y_max_m")


def failed_rows(
    error: str,
    *,
    key: str,
    log: str,
    content: str | None = None,
    bytes: int | None = None,  # noqa: A002 - as the column
    labels: Mapping[str, str] | None = None,
) -> dict[str, pa.Table]:
    """The row of a log that could not be judged, with the line that says why."""
    row = {
        **_log(key, log, content, bytes, labels or {}),
        "status": "failed",
        "error": clean(error),
    }
    return {"logs": _table("logs", key, [row])}


def costs_row(
    *, key: str, cpu_s: float, wall_s: float, peak_mb: float | None, attempts: int
) -> dict[str, pa.Table]:
    """What judging a log cost: the one table that differs from run to run."""
    row = {"cpu_s": cpu_s, "wall_s": wall_s, "peak_mb": peak_mb, "attempts": attempts}
    return {"costs": _table("costs", key, [row])}


def day_of(t_ns: int) -> date | None:
    """The UTC day; None where the clock is none of the wall."""
    if not _FIRST.timestamp() <= t_ns // NS_PER_S < _LAST.timestamp():
        return None
    return datetime.fromtimestamp(t_ns // NS_PER_S, tz=UTC).date()


def driven_m(post: Postmortem) -> float | None:
    """How far the robot drove by hindsight, m, in steps of a second; None without hindsight."""
    if post.hindsight is None or not post.hindsight.track.has_pose.any():
        return None
    at_ns = np.arange(post.manifest.start_ns, post.manifest.end_ns + 1, NS_PER_S)
    step = np.diff(post.hindsight.track.at(at_ns).xyyaw[:, :2], axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    # Steps to and from where nothing is known are NaN, and count for nothing.
    return float(length[(length >= _DRIVES_M_S) & (length <= _CARRIED_M_S)].sum())


def _log(
    key: str, log: str, content: str | None, size: int | None, labels: Mapping[str, str]
) -> dict[str, Any]:
    told = {name: labels.get(name) or None for name in ("site", "robot", "software")}
    return {
        "key": key,
        "log": clean(log),
        "content": content,
        "bytes": size,
        **{name: None if text is None else clean(text) for name, text in told.items()},
        "slamreplay": __version__,
    }


def _seconds(intervals: Iterable[Interval]) -> float:
    return sum(interval.duration_ns for interval in intervals) / NS_PER_S


def _root_cause(report: Report) -> str | None:
    cause = report.root_cause
    if cause is None or cause.reason or not cause.candidates:
        return None
    return cause.candidates[0].kind


def _map_at(post: Postmortem, t_ns: int) -> str | None:
    """The map in whose frame a moment is told."""
    parts = () if post.hindsight is None else post.hindsight.parts
    for part in parts:
        if part.stretch.start_ns <= t_ns < part.stretch.end_ns:
            return part.stretch.version
    return None if post.grid is None else post.grid.version


def _table(name: str, key: str, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    import pyarrow as pa

    picked = [{column: row.get(column) for column in TABLES[name]} | {"key": key} for row in rows]
    return pa.Table.from_pylist(picked, schema=arrow_schema(name))


def _places(key: str, post: Postmortem) -> pa.Table:
    import pyarrow as pa

    columns: dict[str, NDArray[Any]] = dict(places_of(post))
    count = len(columns["col"])
    columns["key"] = np.full(count, key, dtype=object)
    schema = arrow_schema("places")
    return pa.table(
        [pa.array(columns[field.name].tolist(), type=field.type) for field in schema],
        schema=schema,
    )
