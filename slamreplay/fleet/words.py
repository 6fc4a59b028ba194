"""Numbers of a fleet in words."""

from __future__ import annotations


def duration(seconds: float) -> str:
    """As a person says it: 40 s, 12 min, 3.5 h, 1,234 h."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    h = seconds / 3600.0
    if h < 1.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{h:,.1f} h" if h < 100.0 else f"{h:,.0f} h"
