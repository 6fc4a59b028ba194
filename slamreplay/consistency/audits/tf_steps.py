"""SR-TF-004 and 005: steps of odometry that no robot makes, and how far corrections moved it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from slamreplay.audit.log_audit import LogAudit
from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.context import CheckContext

#: A correction by this is worth a word, and by that a warning: half a metre off is lost.
WORD_M, WORD_RAD = 0.2, np.radians(10.0)
WARN_M, WARN_RAD = 0.5, np.radians(20.0)


def check(context: CheckContext) -> tuple[Finding, ...]:
    """Jumps of dead reckoning, and large corrections by the localizer."""
    return (*_jumps(context.audit), *_corrections(context.audit))


def _jumps(audit: LogAudit) -> Iterable[Finding]:
    found = audit.odometry_jumps
    if found is None or not len(found):
        return
    start = audit.view.manifest.start_ns
    far, turn = int(np.argmax(found.metres)), int(np.argmax(found.radians))
    text = (
        f"odometry jumps {len(found)} times as no robot can: by up to {found.metres[far]:.2f} m "
        f"({(found.t_ns[far] - start) / 1e9:.1f} s) and {np.degrees(found.radians[turn]):.0f} deg "
        f"({(found.t_ns[turn] - start) / 1e9:.1f} s)"
    )
    yield Finding("SR-TF-004", "warning", text, int(found.t_ns[0]), int(found.t_ns[-1]),
                  value=float(found.metres[far]), unit="m", n=len(found))  # fmt: skip


def _corrections(audit: LogAudit) -> Iterable[Finding]:
    found = audit.corrections
    if found is None or not len(found):
        return
    steps = found.at_robot
    large = (steps.metres >= WORD_M) | (steps.radians >= WORD_RAD)
    if not large.any():
        return
    far = int(np.argmax(steps.metres))
    most = float(np.degrees(steps.radians.max()))
    count = int(large.sum())
    far_s = (steps.t_ns[far] - audit.view.manifest.start_ns) / 1e9
    text = (
        f"{count} correction{'s' if count > 1 else ''} moved the robot in the map by {WORD_M:g} m "
        f"or 10 deg and more, at the most {steps.metres[far]:.2f} m ({far_s:.1f} s) and "
        f"{most:.0f} deg; the odometry frame's origin moved by up to {found.at_origin.max():.2f} m"
    )
    grave = bool((steps.metres >= WARN_M).any() or (steps.radians >= WARN_RAD).any())
    severity: Severity = "warning" if grave else "info"
    t = steps.t_ns[large]
    yield Finding("SR-TF-005", severity, text, int(t[0]), int(t[-1]),
                  value=float(steps.metres[far]), unit="m", n=len(found))  # fmt: skip
