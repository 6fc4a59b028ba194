"""SR-MAP-003: the log was given more than one map, and what that means for the verdict."""

from __future__ import annotations

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.bundle.map_course import SHORTEST_NS
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.times import NS_PER_S


def map_course_findings(view: BundleView) -> tuple[Finding, ...]:
    """Which versions held, and where one is of another place; nothing where one held all along."""
    course, stretches = view.map_course, view.map_stretches
    count = len({held.version for held in course})
    if count < 2:
        return ()
    start = view.manifest.start_ns
    since = (course[-1].start_ns - start) / NS_PER_S
    text = (
        f"{count} map versions held, the last one from {since:.1f} s on: each moment's beams are "
        "compared with the version of that time"
    )
    if len(stretches) > 1:
        cuts = ", ".join(f"{(s.start_ns - start) / NS_PER_S:.1f} s" for s in stretches[1:])
        text += (
            f"; at {cuts} one came that shows another place, or this one much otherwise: "
            "each stretch is judged in its own"
        )
    judged = {held.version for stretch in stretches for held in stretch.held}
    passing = count - len(judged)
    if passing:
        text += (
            f"; {passing} of another place held for less than {SHORTEST_NS / NS_PER_S:.0f} s at a "
            "time: passed over, as if the one before had held on (do two nodes publish the map?)"
        )
    severity: Severity = "warning" if passing else "info"
    return (Finding("SR-MAP-003", severity, text, course[0].start_ns, course[-1].end_ns, n=count),)
