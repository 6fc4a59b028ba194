"""SR-LOC-005: did the belief jump, and what made it?"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.belief.jumps.found import Jump, jumps_of
from slamreplay.consistency.context import CheckContext

#: So many jumps of a belief are told one by one, the largest first; the report has all.
MOST_TOLD = 3


def check(context: CheckContext) -> tuple[Finding, ...]:
    """One finding for a belief that jumped; small steps, and those that led home, are info."""
    found = jumps_of(context)
    if not found:
        return ()
    start = context.view.manifest.start_ns
    largest = sorted(found, key=lambda jump: -jump.step.size)
    grave = [jump for jump in found if jump.step.is_grave]
    size = "0.5 m or 20 deg" if grave else "0.2 m or 10 deg"
    count = len(grave or found)
    told = "; ".join(sentence(jump, start) for jump in largest[:MOST_TOLD])
    more = len(found) - MOST_TOLD
    text = f"the belief jumped {count} time{'s' if count > 1 else ''} by {size} and more: {told}"
    text += f"; and {more} smaller ones" if more > 0 else ""
    accused = [jump for jump in grave if jump.led_astray is not False and not jump.is_given]
    severity: Severity = "warning" if accused else "info"
    worst = largest[0].step
    return (
        Finding(
            "SR-LOC-005",
            severity,
            text,
            start_ns=found[0].step.t_ns,
            end_ns=found[-1].step.t_ns,
            value=worst.metres,
            unit="m",
            n=len(found),
        ),
    )


def sentence(jump: Jump, start_ns: int) -> str:
    """When, how far, from which error to which, and what made it."""
    step = jump.step
    text = f"at {(step.t_ns - start_ns) / 1e9:.1f} s by {step.metres:.2f} m and "
    text += f"{np.degrees(step.radians):.0f} deg"
    if jump.error_before_m is not None and jump.error_after_m is not None:
        text += f" (from {jump.error_before_m:.2f} m off to {jump.error_after_m:.2f} m off)"
    return f"{text}, {jump.cause}"
