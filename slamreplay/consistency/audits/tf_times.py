"""SR-TF-003: were transforms there when scans needed them?"""

from __future__ import annotations

from collections.abc import Iterable

from slamreplay.audit.log_audit import LogAudit, key
from slamreplay.audit.tf_cover import LONG_S, Cover
from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.context import CheckContext

#: Scans at the ends of a log that no transform carries: fewer, by less, are how logs are cut.
FEW, FEW_S = 3, 0.5
#: Beyond this share of the scans it is worth a warning.
SHARE = 0.01
#: A transform that carries the robot and does not come for so long leaves it nowhere.
GAP_S = 1.0


def check(context: CheckContext) -> tuple[Finding, ...]:
    """What transforms did not carry, and the gaps of those that carry the robot."""
    return (*_covers(context.audit), *_gaps(context.audit))


def _covers(audit: LogAudit) -> Iterable[Finding]:
    for topic, told in audit.covers.items():
        words, grave = _words(told)
        if words:
            severity: Severity = "warning" if grave else "info"
            text = f"{topic} and the transforms from odometry to it: {'; '.join(words)}"
            yield Finding("SR-TF-003", severity, text, told.worst_ns, told.worst_ns,
                          value=told.wait_most_s, unit="s", n=told.scans)  # fmt: skip


def _words(told: Cover) -> tuple[list[str], bool]:
    words, grave, n = [], False, told.scans
    outside = told.early + told.late
    if outside > FEW or told.outside_s > FEW_S:
        words.append(
            f"{told.early} scans come before the first one and {told.late} after the last, by up "
            f"to {told.outside_s:.2f} s"
        )
        grave |= outside > SHARE * n
    if told.bridged:
        words.append(f"{told.bridged} scans fall into gaps, the widest {told.bridged_s:.2f} s")
        grave = True
    if told.long_waits:
        words.append(
            f"{told.long_waits} of {n} scans had to wait for them longer than {LONG_S:g} s, up to "
            f"{told.wait_most_s:.2f} s (typically {told.wait_median_s:.3f} s)"
        )
        grave |= told.long_waits > SHARE * n
    if told.forgotten:
        words.append(f"{told.forgotten} scans came when tf2 had forgotten theirs (10 s)")
        grave = True
    return words, grave


def _gaps(audit: LogAudit) -> Iterable[Finding]:
    manifest = audit.view.manifest
    for stream in audit.moving:
        rhythm = audit.rates[key(stream)]
        if not rhythm.gaps or not rhythm.period_s:
            continue
        worst = rhythm.gaps[0]
        at = (worst.start_ns - manifest.start_ns) / 1e9
        count = len(rhythm.gaps)
        many = "a gap of" if count == 1 else f"{count} gaps, the longest"
        text = f"{stream.name} at {1.0 / rhythm.period_s:.1f} Hz has {many} {worst.seconds:.2f} s "
        text += f"at {at:.1f} s"
        carries = not stream.is_edge(manifest.frames.map, manifest.frames.odom)
        severity: Severity = "warning" if carries and worst.seconds >= GAP_S else "info"
        yield Finding("SR-TF-003", severity, text, worst.start_ns, worst.end_ns,
                      value=worst.seconds, unit="s", n=len(stream))  # fmt: skip
