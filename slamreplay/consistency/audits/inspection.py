"""What is in a bundle, what is missing, and whether its clocks, frames and numbers hold together.

It stands above the checks, for it says what they say of a log without asking where the robot was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.audit.delays import Delays, delays
from slamreplay.audit.log_audit import LogAudit, key
from slamreplay.audit.rates import Rate
from slamreplay.audit.streams import SENSOR_TABLES, Stream
from slamreplay.bundle.role_tables import ROLE_TABLES
from slamreplay.bundle.view import Bundle
from slamreplay.consistency import AUDITS
from slamreplay.consistency.asking import ask
from slamreplay.consistency.audits.inspection_frames import frames_audit
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry.times import NS_PER_S

#: So many gaps of a stream are spelt out, the longest first.
_GAPS = 5
#: Tables whose topics come at a rate; all else comes when there is something to say.
_RHYTHMIC = frozenset({*SENSOR_TABLES, "references", "costmaps"})


def summary(bundle: Bundle) -> dict[str, Any]:
    """What is there and what is missing, as plain data that JSON can hold.

    Keys: bundle, roles, missing, tables, maps, losses. Times are integer ns on the bundle's clock,
    durations in s, rates in Hz; numbers that cannot be said are None.
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
        "maps": [m.model_dump(mode="json") for m in manifest.maps],
        "losses": [loss.model_dump() for loss in manifest.losses],
    }


def inspect(bundle: Bundle) -> dict[str, Any]:
    """The answers of `slamreplay inspect`: those of `summary`, and the audit.

    Keys beside those of `summary` and `clock_and_frames`: lasers, placeholders, findings.
    """
    context = CheckContext(None, (), bundle.view())
    whole = LogAudit(bundle.view(), bundle.table)  # its topics are told, references too
    found = ask([context], AUDITS)
    return {
        **summary(bundle),
        **clock_and_frames(context.audit, whole),
        "lasers": {topic: asdict(told) for topic, told in context.audit.lasers.items()},
        "placeholders": [asdict(odd) for odd in context.audit.odd_numbers],
        "findings": [{**asdict(f), "title": f.title} for f in found],
    }


def clock_and_frames(audit: LogAudit, whole: LogAudit | None = None) -> dict[str, Any]:
    """How the log's clocks and tf hold together, as plain data.

    Args:
        audit: of what a check may see.
        whole: of all topics that are to be told; the same if not given.
    """
    clock = audit.view.manifest.clock
    return {
        "clock": {
            "name": clock.name,
            "reason": clock.reason,
            "simulated": _simulated(audit),
            "topics": _topics(whole or audit),
        },
        "frames": frames_audit(audit),
    }


def _role_rate(bundle: Bundle, role: str, topic: str) -> float | None:
    """Of the topic in its role's table; where tf plays it, in that of tf, whatever it is called."""
    for name in (ROLE_TABLES[role], "transforms"):
        t_log_ns = bundle.log_times(name, topic)
        if len(t_log_ns):
            return _rate(t_log_ns)
    return None


def _rate(t_log_ns: NDArray[np.int64]) -> float | None:
    """Messages per second of log time (rows of one message share theirs)."""
    times = np.unique(t_log_ns)
    span = float(times[-1] - times[0]) / NS_PER_S if len(times) > 1 else 0.0
    return round((len(times) - 1) / span, 3) if span > 0.0 else None


def _simulated(audit: LogAudit) -> dict[str, Any] | None:
    """What /clock said: how often, and how fast its time went by against the log's."""
    said = audit.simulated
    if said is None:
        return None
    span = int(said.t_log_ns[-1] - said.t_log_ns[0])
    went = int(said.t_sensor_ns[-1] - said.t_sensor_ns[0])
    return {
        "topic": said.topic,
        "messages": len(said),
        "start_ns": int(said.t_sensor_ns[0]),
        "pace": went / span if span > 0 else None,
    }


def _topics(audit: LogAudit) -> list[dict[str, Any]]:
    """How each topic is stamped, how late it was recorded, and how regularly it came."""
    topics: dict[tuple[str, str], list[Stream]] = {}
    for stream in audit.streams:
        topics.setdefault((stream.table, stream.topic), []).append(stream)
    return [_topic(audit, parts) for parts in topics.values()]


def _topic(audit: LogAudit, parts: Sequence[Stream]) -> dict[str, Any]:
    """One topic; of tf all its edges together, of which each has a rhythm of its own."""
    one = parts[0]
    t_log = np.concatenate([p.t_log_ns for p in parts])
    stamps = np.concatenate([p.t_sensor_ns for p in parts])
    t_ns = np.concatenate([p.t_ns for p in parts])
    stamped = np.concatenate([p.stamped for p in parts])
    own_stamp = bool(stamped.any()) and bool((t_ns == stamps)[stamped].all())
    late = audit.delays[key(one)] if len(parts) == 1 else delays(t_log, stamps)
    odd = [audit.odd_stamps[key(p)] for p in parts]
    rhythm = audit.rates[key(one)] if one.table in _RHYTHMIC else None
    return {
        "topic": one.topic,
        "table": one.table,
        "rows": len(t_log),
        "rate_hz": _rate(t_log),
        "stamped": int(stamped.sum()),
        "by": "header stamp" if own_stamp else "log time" if not stamped.any() else "both",
        **_delay(late, moves=len(parts) == 1),
        "unstamped": sum(o.zero for o in odd),
        "repeated_stamps": sum(o.repeated for o in odd),
        "backward_stamps": sum(o.backwards for o in odd),
        **_rhythm(rhythm),
    }


def _delay(late: Delays | None, *, moves: bool) -> dict[str, Any]:
    names = ("log_minus_stamp_median_s", "log_minus_stamp_p95_s", "log_minus_stamp_least_s",
             "log_minus_stamp_jitter_s", "drift_ppm", "jumps")  # fmt: skip
    if late is None:
        return dict.fromkeys(names, None)
    jumps = [asdict(jump) for jump in late.jumps] if moves else []
    drift = None if late.drift_ppm is None or not moves else round(late.drift_ppm, 3)
    offsets = (late.median_s, late.p95_s, late.least_s, late.jitter_s)
    return dict(zip(names, (*(round(s, 6) for s in offsets), drift, jumps), strict=True))


def _rhythm(rhythm: Rate | None) -> dict[str, Any]:
    """A rhythm as plain data; the worst gaps are spelt out."""
    if rhythm is None:
        names = ("period_s", "period_jitter_s", "missing", "gap_count")
        return {**dict.fromkeys(names, None), "gaps": []}
    return {
        "period_s": rhythm.period_s,
        "period_jitter_s": rhythm.jitter_s,
        "missing": rhythm.missing if rhythm.is_regular else None,
        "gap_count": len(rhythm.gaps) if rhythm.is_regular else None,
        "gaps": [asdict(gap) for gap in rhythm.gaps[:_GAPS]],
    }
