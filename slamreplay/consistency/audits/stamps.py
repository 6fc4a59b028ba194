"""SR-CLK-005 to 007: stamps that cannot be, gaps, transforms that are dated ahead on purpose."""

from __future__ import annotations

from collections.abc import Iterable

from slamreplay.audit.log_audit import LogAudit, key
from slamreplay.audit.streams import SENSOR_TABLES, Stream
from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.audits.clock import LATE_SKEW_S, listed
from slamreplay.consistency.context import CheckContext

#: Stamps this far ahead of the log time keep tf lookups waiting.
AHEAD_S = 0.1
#: Zero stamps beyond this share, and missing messages beyond these, are worth a warning or a word.
ZERO, MISSING, FEW_MISSING = 0.1, 0.1, 0.02
#: A sensor that is silent for so long leaves a hole in the evidence.
GAP_S = 1.0
#: A sensor that starts or ends so long after or before the log is worth a word.
EDGE_S = 5.0


def check(context: CheckContext) -> tuple[Finding, ...]:
    """One finding for each kind of odd stamp, for gaps, and for leads."""
    audit = context.audit
    return (*_odd(audit), *_gaps(audit), *_leads(audit))


def _odd(audit: LogAudit) -> Iterable[Finding]:
    localizer = [s for s in audit.streams if s.table in ("poses", "particles")]
    streams = list(dict.fromkeys([*audit.sensors, *audit.moving, *localizer]))
    topics = {r.topic for r in audit.view.manifest.roles}
    zero, back, twice, ahead = [], [], [], []
    grave: dict[str, bool] = dict.fromkeys(("zero", "back", "ahead"), False)
    for stream in streams:
        odd, late, n = audit.odd_stamps[key(stream)], audit.delays[key(stream)], len(stream)
        counts = stream.table in SENSOR_TABLES and stream.topic in topics
        if odd.zero:
            zero.append((f"{stream.name} {odd.zero} of {n}", stream))
            grave["zero"] |= counts and odd.zero > ZERO * n
        if odd.backwards:
            text = f"{stream.name} {odd.backwards} of {n}, by up to {odd.back_s:.3f} s"
            back.append((text, stream))
            grave["back"] |= counts
        if odd.repeated:
            twice.append((f"{stream.name} {odd.repeated} of {n}", stream))
        if late is None or _is_lead(stream, audit):
            continue
        if late.lead_s is not None and late.lead_s < LATE_SKEW_S:
            ahead.append((f"{stream.name} all {late.n}, by {late.lead_s:.3f} s", stream))
            grave["ahead"] |= late.lead_s >= AHEAD_S
        elif late.lead_s is None and late.ahead:
            ahead.append((f"{stream.name} {late.ahead} of {late.n}", stream))
    yield from _told("messages without a stamp", zero, "warning" if grave["zero"] else "info")
    yield from _told("stamps that go back", back, "warning" if grave["back"] else "info")
    yield from _told("stamps that repeat the one before", twice, "info")
    severity: Severity = "warning" if grave["ahead"] else "info"
    yield from _told("stamps later than the log time", ahead, severity)


def _told(what: str, found: list[tuple[str, Stream]], severity: Severity) -> Iterable[Finding]:
    if found:
        start = min(int(stream.t_ns.min()) for _, stream in found)
        end = max(int(stream.t_ns.max()) for _, stream in found)
        text = f"{what}: {listed([text for text, _ in found])}"
        n = sum(len(stream) for _, stream in found)
        yield Finding("SR-CLK-005", severity, text, start, end, n=n)


def _gaps(audit: LogAudit) -> Iterable[Finding]:
    """One finding for each sensor that was silent, lost messages, came late or left early."""
    manifest = audit.view.manifest
    topics = {r.topic for r in manifest.roles}
    for stream in audit.sensors:
        rhythm, n = audit.rates[key(stream)], len(stream)
        if stream.edge is not None or not rhythm.is_regular or not rhythm.period_s:
            continue
        share = rhythm.missing / (n + rhythm.missing)
        words, start, end = [], manifest.start_ns, manifest.end_ns
        longest = 0.0
        if rhythm.gaps:
            worst = rhythm.gaps[0]
            start, end, longest = worst.start_ns, worst.end_ns, worst.seconds
            at = (worst.start_ns - manifest.start_ns) / 1e9
            many = "a gap of" if len(rhythm.gaps) == 1 else f"{len(rhythm.gaps)} gaps, the longest"
            words.append(f"{many} {longest:.2f} s at {at:.1f} s")
        if rhythm.gaps or share >= FEW_MISSING:
            words.append(f"{rhythm.missing} of {n + rhythm.missing} messages missing")
        if rhythm.late_start_s > EDGE_S:
            words.append(f"begins {rhythm.late_start_s:.1f} s after the log")
        if rhythm.early_end_s > EDGE_S:
            words.append(f"ends {rhythm.early_end_s:.1f} s before the log")
        if not words:
            continue
        grave = stream.topic in topics and (longest >= GAP_S or share >= MISSING)
        text = f"{stream.name} at {1.0 / rhythm.period_s:.1f} Hz: {'; '.join(words)}"
        yield Finding("SR-CLK-006", "warning" if grave else "info", text, start, end,
                      value=longest or None, unit="s" if longest else "", n=n)  # fmt: skip


def _is_lead(stream: Stream, audit: LogAudit) -> bool:
    """Whether stamps lie ahead on purpose: only what corrects odometry has reason to be."""
    frames = audit.view.manifest.frames
    return stream.is_edge(frames.map, frames.odom) and key(stream) in audit.leads


def _leads(audit: LogAudit) -> Iterable[Finding]:
    """That corrections are dated ahead on purpose is said, so that nobody calls it a fault."""
    for stream in audit.moving:
        if not _is_lead(stream, audit):
            continue
        own = audit.leads[key(stream)]
        made = "when it was sent, on purpose"
        if own.over == "scan":
            made = "the scan it was made from (transform_tolerance)"
        text = f"{stream.name} is dated {own.seconds:.3f} s ahead of {made}: no fault of a clock"
        t = stream.t_ns
        yield Finding("SR-CLK-007", "info", text, int(t.min()), int(t.max()), value=own.seconds,
                      unit="s", n=own.n)  # fmt: skip
