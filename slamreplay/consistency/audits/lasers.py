"""SR-DAT-005: do a laser's numbers fit each other?"""

from __future__ import annotations

from collections.abc import Iterable

from slamreplay.audit.lasers import LaserNumbers
from slamreplay.bundle.findings import Finding, Severity
from slamreplay.bundle.manifest import ODD_ANGLES
from slamreplay.consistency.context import CheckContext

#: A sweep may take this much of the time between scans; beyond it deskewing bends the scans.
SWEEP = 1.1
#: scan_time may be off by this part of the real period.
SCAN_TIME = 0.2
#: Beyond this share of the scans it is worth a warning.
SHARE = 0.01


def check(context: CheckContext) -> tuple[Finding, ...]:
    """One finding for each laser whose numbers do not fit."""
    manifest = context.view.manifest
    angles = {loss.what: loss.count for loss in manifest.losses if loss.reason == ODD_ANGLES}
    found = []
    for topic, told in context.audit.lasers.items():
        words = list(_words(told, angles.get(topic, 0)))
        if words:
            severity: Severity = "warning" if any(grave for _, grave in words) else "info"
            text = f"{topic}: {'; '.join(text for text, _ in words)}"
            found.append(Finding("SR-DAT-005", severity, text, manifest.start_ns, manifest.end_ns,
                                 n=told.scans))  # fmt: skip
    return tuple(found)


def _words(told: LaserNumbers, angles: int) -> Iterable[tuple[str, bool]]:
    """What does not fit, and whether it bends or empties what is read of the scans."""
    n = told.scans
    if told.blank:
        yield f"{told.blank} of {n} scans have no beam that says anything", told.blank > SHARE * n
    if told.equal:
        yield f"{told.equal} of {n} scans tell one range in all beams", told.equal > SHARE * n
    if told.frozen:
        yield f"{told.frozen} of {n} scans repeat the one before although the robot moved", True
    if told.no_limits:
        yield f"range_max is not beyond range_min in {told.no_limits} of {n} scans", True
    if angles:
        yield f"angle_max does not fit the increments and beams of {angles} scans", False
    if told.sweep_s < 0.0:
        yield f"time_increment runs backwards ({told.sweep_s:.3f} s over a scan)", True
    period = told.period_s
    if period and told.sweep_s > SWEEP * period:
        long = f"time_increment makes a scan last {told.sweep_s:.3f} s"
        yield f"{long}, but they come every {period:.3f} s", True
    if period and told.scan_time_s > 0.0 and abs(told.scan_time_s / period - 1.0) > SCAN_TIME:
        yield f"scan_time says {told.scan_time_s:.3f} s, but they come every {period:.3f} s", False
