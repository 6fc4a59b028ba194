"""SR-CLK-001: do header stamps and log times tell the same story?"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.consistency.context import CheckContext

#: Offsets beyond this are another epoch or simulated time, not a slow network.
EPOCH_S = 60.0
#: Log times below this are no dates, ns: a month after the epoch.
RELATIVE_NS = 30 * 86_400 * 10**9
#: From here on the offset is worth a word, and its change over the log a warning.
OFFSET_S, DRIFT_S = 1.0, 0.1


def check(context: CheckContext) -> tuple[Finding, ...]:
    """What the manifest's clock knots say: median of log time minus stamp, and its drift."""
    manifest = context.view.manifest
    clock = manifest.clock
    start, end = manifest.start_ns, manifest.end_ns
    if clock.name == "log":
        text = f"header stamps could not be used, log times were: {clock.reason}"
        return (Finding("SR-CLK-001", "warning", text, start, end),)
    if not clock.knots:
        return ()
    offsets = np.array([log - sensor for log, sensor in clock.knots], dtype=np.int64) / 1e9
    median = float(np.median(offsets))
    drift = float(offsets[-1] - offsets[0])
    numbers = f"log time minus header stamp is {median:.3f} s and changes by {drift:+.3f} s"
    n = len(offsets)
    if abs(median) > EPOCH_S:
        why = "stamps of another epoch (simulated time, or a log that was replayed)"
        if median < 0.0 and 0 <= clock.knots[0][0] < RELATIVE_NS:
            why = "log times count from when the recorder was started"
        text = f"{numbers}: {why}"
        return (Finding("SR-CLK-001", "info", text, start, end, value=median, unit="s", n=n),)
    if abs(drift) > DRIFT_S:
        text = f"{numbers} over the log: the two clocks run at different speeds"
        return (Finding("SR-CLK-001", "warning", text, start, end, value=drift, unit="s", n=n),)
    if abs(median) > OFFSET_S:
        return (Finding("SR-CLK-001", "info", numbers, start, end, value=median, unit="s", n=n),)
    return ()
