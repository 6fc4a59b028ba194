"""SR-CLK-001, 003 and 004: do header stamps and log times, and all stamps, tell one story?"""

from __future__ import annotations

import numpy as np

from slamreplay.audit.delays import Jump
from slamreplay.audit.log_audit import LogAudit, key
from slamreplay.audit.streams import SENSOR_TABLES, Stream
from slamreplay.bundle.findings import Finding, Severity
from slamreplay.bundle.manifest import Clock
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry.times import NS_PER_S

#: Offsets beyond this are another epoch or simulated time, not a slow network.
EPOCH_S = 60.0
#: Log times below this are no dates, ns: a month after the epoch.
RELATIVE_NS = 30 * 86_400 * 10**9
#: From here on the offset is worth a word, and its change over the log a warning.
OFFSET_S, DRIFT_S = 1.0, 0.1
#: No quartz runs this much faster than another: that is simulated time, or a replay.
OTHER_PACE_PPM = 1000.0
#: Stamps before this, in s, count from a start, not from 1970.
_YEAR_2001_S = 1e9
#: A jump of this size is a warning.
JUMP_S = 0.1
#: Jumps of several streams within this are one.
_TOGETHER_NS = NS_PER_S
#: A sensor whose stamps lie this far from the others' has another clock; localizers date ahead.
SKEW_S, LATE_SKEW_S = 1.0, 15.0
#: So many streams are named in a sentence.
_NAMED = 4


def check(context: CheckContext) -> tuple[Finding, ...]:
    """Offset, drift and pace of the clocks; jumps; streams on another clock."""
    clock = context.view.manifest.clock
    start, end = context.view.manifest.start_ns, context.view.manifest.end_ns
    if clock.name == "log":
        text = f"header stamps could not be used, log times were: {clock.reason}"
        return (Finding("SR-CLK-001", "warning", text, start, end),)
    return (*_offset(context), *_jumps(context.audit, clock), *_skews(context.audit, clock))


def _offset(context: CheckContext) -> tuple[Finding, ...]:
    manifest, audit = context.view.manifest, context.audit
    knots, start, end = manifest.clock.knots, manifest.start_ns, manifest.end_ns
    if not knots:
        return ()
    offsets = np.array([log - sensor for log, sensor in knots], dtype=np.int64) / NS_PER_S
    median, n = float(np.median(offsets)), len(offsets)
    drift, ppm = _drift(audit, manifest.clock)
    if drift is None:
        drift = float(offsets[-1] - offsets[0]) if not audit.sensors else 0.0
    numbers = f"log time minus header stamp is {median:.3f} s and "
    numbers += f"changes by {drift:+.3f} s" if drift else "does not drift"
    if ppm is not None:
        numbers += f" ({ppm:+.0f} ppm, {3.6e-3 * ppm:+.2f} s per hour)"
    stamps = np.array([sensor for _, sensor in knots], dtype=np.int64) / NS_PER_S
    simulated = bool(np.median(stamps) < _YEAR_2001_S < np.median(stamps + offsets))
    if abs(median) > EPOCH_S or (simulated and ppm is not None):
        pace = "" if ppm is None else f", at {1.0 - 1e-6 * ppm:.4f} of the log's pace"
        told = "another epoch (a log that was replayed, or another computer's clock)"
        said = audit.simulated
        follows = said is not None and abs(_away(said, manifest.clock) or 0.0) < LATE_SKEW_S
        if simulated or follows:
            by = f", as {said.topic} says" if said is not None and follows else ""
            told = f"simulated time{by}"
        elif median < 0.0 and 0 <= knots[0][0] < RELATIVE_NS:
            text = f"{numbers}: log times count from when the recorder was started"
            return (Finding("SR-CLK-001", "info", text, start, end, value=median, unit="s", n=n),)
        elif ppm is not None and abs(ppm) > OTHER_PACE_PPM:
            told = "another epoch and pace (simulated time, or a replay)"
        text = f"{numbers}: stamps of {told}{pace}"
        return (Finding("SR-CLK-001", "info", text, start, end, value=median, unit="s", n=n),)
    if abs(drift) > DRIFT_S:
        text = f"{numbers} over the log: the two clocks run at different speeds"
        return (Finding("SR-CLK-001", "warning", text, start, end, value=drift, unit="s", n=n),)
    if abs(median) > OFFSET_S:
        return (Finding("SR-CLK-001", "info", numbers, start, end, value=median, unit="s", n=n),)
    return ()


def _drift(audit: LogAudit, clock: Clock) -> tuple[float | None, float | None]:
    """Drift of the sensors' clock against the log's in s and ppm: of its densest stream."""
    own = [s for s in audit.sensors if abs(_away(s, clock) or 0.0) < SKEW_S]
    for stream in sorted(own, key=len, reverse=True):
        late = audit.delays[key(stream)]
        if late is not None and late.drift_s is not None:
            return late.drift_s, late.drift_ppm
    return None, None


def _jumps(audit: LogAudit, clock: Clock) -> tuple[Finding, ...]:
    """One finding for each moment at which stamps of sensors jumped against the log time."""
    told: list[tuple[Jump, Stream]] = []
    for stream in audit.sensors:
        late = audit.delays[key(stream)]
        told += [] if late is None else [(jump, stream) for jump in late.jumps]
    told.sort(key=lambda pair: (pair[0].t_log_ns, pair[1].name))
    groups: list[list[tuple[Jump, Stream]]] = []
    for jump, stream in told:
        last = groups[-1][-1][0] if groups else None
        same = last is not None and jump.t_log_ns - last.t_log_ns < _TOGETHER_NS
        if same and last is not None and last.seconds * jump.seconds > 0.0:
            groups[-1].append((jump, stream))
        else:
            groups.append([(jump, stream)])
    stamped = sum(audit.delays[key(s)] is not None for s in audit.sensors)
    if len(groups) > _NAMED:
        return (_many_jumps(groups, clock),)
    return tuple(_jump(group, clock, stamped) for group in groups)


def _many_jumps(groups: list[list[tuple[Jump, Stream]]], clock: Clock) -> Finding:
    """One finding for a clock that jumps all the time: each by itself would bury all others."""
    worst = max(groups, key=lambda group: abs(group[0][0].seconds))[0][0].seconds
    names = sorted({stream.name for group in groups for _, stream in group})
    text = f"stamps of {listed(names)} jumped {len(groups)} times against the log time, by up to "
    ends = np.array([group[0][0].t_log_ns for group in (groups[0], groups[-1])])
    start, end = (int(t) for t in clock.from_log_time(ends))
    severity: Severity = "warning" if abs(worst) >= JUMP_S else "info"
    return Finding("SR-CLK-003", severity, f"{text}{abs(worst):.3f} s", start, end, value=worst,
                   unit="s", n=len(groups))  # fmt: skip


def _jump(group: list[tuple[Jump, Stream]], clock: Clock, stamped: int) -> Finding:
    seconds = float(np.median([jump.seconds for jump, _ in group]))
    names = [stream.name for _, stream in group]
    whose = "all sensors" if len(group) == stamped > 1 else listed(names)
    way = "went ahead" if seconds > 0.0 else "fell back"
    text = f"stamps of {whose} {way} by {abs(seconds):.3f} s against the log time and stayed there"
    (at,) = clock.from_log_time(np.array([group[0][0].t_log_ns]))
    severity: Severity = "warning" if abs(seconds) >= JUMP_S else "info"
    return Finding("SR-CLK-003", severity, text, int(at), int(at), value=seconds, unit="s",
                   n=len(group))  # fmt: skip


def _skews(audit: LogAudit, clock: Clock) -> tuple[Finding, ...]:
    """Streams that lie off the others' clock all the time."""
    found: list[tuple[float, Stream]] = []
    others = [s for s in audit.streams if s.table in ("poses", "particles")]
    for stream in dict.fromkeys([*audit.sensors, *audit.moving, *others]):
        away = _away(stream, clock)
        limit = SKEW_S if stream.table in SENSOR_TABLES else LATE_SKEW_S
        if away is not None and abs(away) > limit:
            found.append((away, stream))
    if not found:
        return ()
    found.sort(key=lambda pair: -abs(pair[0]))
    texts = [f"{stream.name} {away:+.3f} s" for away, stream in found]
    start = min(int(stream.t_ns.min()) for _, stream in found)
    end = max(int(stream.t_ns.max()) for _, stream in found)
    text = f"not on the clock of the other sensors: {listed(texts)}"
    rows = sum(len(stream) for _, stream in found)
    return (
        Finding("SR-CLK-004", "warning", text, start, end, value=found[0][0], unit="s", n=rows),
    )


def _away(stream: Stream, clock: Clock) -> float | None:
    """How far ahead of the bundle's clock a stream's stamps lie, in s; None without stamps."""
    if not stream.stamped.any():
        return None
    there = clock.from_log_time(stream.t_log_ns[stream.stamped])
    return float(np.median(stream.t_sensor_ns[stream.stamped] - there)) / NS_PER_S


def listed(texts: list[str]) -> str:
    """A few of them, and how many more there are."""
    more = len(texts) - _NAMED
    return ", ".join(texts[:_NAMED]) + (f" and {more} more" if more > 0 else "")
