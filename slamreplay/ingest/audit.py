"""What is in a bundle, what is missing, and whether its clocks and frames hold together."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import ROLE_TABLES, Bundle
from slamreplay.geometry.times import NO_STAMP, NS_PER_S


def inspect(bundle: Bundle) -> dict[str, Any]:
    """The answers of `slamreplay inspect` as plain data that JSON can hold.

    Keys: bundle, roles, missing, tables, clock, frames, maps, losses. Times are integer ns on the
    bundle's clock, durations and offsets in s, rates in Hz; numbers that cannot be said are None.
    """
    manifest = bundle.manifest
    return {
        "bundle": {
            "id": manifest.bundle_id,
            "format_version": manifest.format_version,
            "sources": [s.model_dump() for s in manifest.sources],
            "options": manifest.options,
            "start_ns": manifest.start_ns,
            "end_ns": manifest.end_ns,
            "duration_s": (manifest.end_ns - manifest.start_ns) / NS_PER_S,
        },
        "roles": [
            {**role.model_dump(), "rate_hz": _role_rate(bundle, role.role, role.topic)}
            for role in manifest.roles
        ],
        "missing": [m.model_dump() for m in manifest.missing],
        "tables": {name: entry.rows for name, entry in manifest.tables.items()},
        "clock": {
            "name": manifest.clock.name,
            "reason": manifest.clock.reason,
            "topics": _clock_audit(bundle),
        },
        "frames": {
            "map": manifest.frames.map,
            "odom": manifest.frames.odom,
            "base": manifest.frames.base,
            "tree": [e.model_dump() for e in manifest.frames.tree],
            "without_tf": _without_tf(bundle),
        },
        "maps": [m.model_dump() for m in manifest.maps],
        "losses": [loss.model_dump() for loss in manifest.losses],
    }


def _role_rate(bundle: Bundle, role: str, topic: str) -> float | None:
    """Of the topic in its role's table; where tf plays it, in that of tf, whatever it is called."""
    for table in (bundle.table(ROLE_TABLES[role]), bundle.table("transforms")):
        mine = table["topic"] == topic
        if mine.any():
            return _rate(table["t_log_ns"][mine])
    return None


def _rate(t_log_ns: NDArray[np.int64]) -> float | None:
    """Messages per second of log time (rows of one message share theirs)."""
    times = np.unique(t_log_ns)
    span = float(times[-1] - times[0]) / NS_PER_S if len(times) > 1 else 0.0
    return round((len(times) - 1) / span, 3) if span > 0.0 else None


def _clock_audit(bundle: Bundle) -> list[dict[str, Any]]:
    """How far the log time is behind the header stamp, by topic."""
    out = []
    for name in TABLES:
        table = bundle.table(name)
        for topic in sorted(set(table["topic"])):
            rows = table.take(table["topic"] == topic)
            out.append({"topic": topic, "table": name, "rows": len(rows), **_offsets(rows)})
    return out


def _offsets(rows: Table) -> dict[str, Any]:
    stamped = rows["t_sensor_ns"] != NO_STAMP
    late = (rows["t_log_ns"] - np.where(stamped, rows["t_sensor_ns"], 0))[stamped]
    own_stamp = bool(stamped.any()) and bool((rows.t_ns == rows["t_sensor_ns"])[stamped].all())
    seconds = late / NS_PER_S
    return {
        "rate_hz": _rate(rows["t_log_ns"]),
        "stamped": int(stamped.sum()),
        "by": "header stamp" if own_stamp else "log time" if not stamped.any() else "both",
        "log_minus_stamp_median_s": round(float(np.median(seconds)), 6) if len(late) else None,
        "log_minus_stamp_p95_s": round(float(np.percentile(seconds, 95)), 6) if len(late) else None,
    }


def _without_tf(bundle: Bundle) -> list[str]:
    """Sensor frames that do not hang in the base's tree: they are taken to be the base itself."""
    manifest = bundle.manifest
    base = manifest.frames.base
    transforms = bundle.view().transforms
    frames = {f for name in ("scans", "points", "imu") for f in set(bundle.table(name)["frame_id"])}
    if base is None:
        return sorted(frames)
    return sorted(f for f in frames if f != base and not transforms.has_path(base, f))
