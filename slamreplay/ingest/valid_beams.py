"""How much a laser sees: what lasers are chosen by."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.no_return import told_as_range_max
from slamreplay.ingest.rows import TopicRows


def valid_beams(topic: TopicRows) -> float:
    """Beams of all scans within their range limits."""
    ranges = topic.columns["ranges_m"]
    far = ranges.spread(topic.columns["range_max_m"])
    near = ranges.spread(topic.columns["range_min_m"])
    with np.errstate(invalid="ignore"):
        inside = (ranges.values >= near) & (ranges.values <= far) & (ranges.values > 0)
    inside &= ~told_as_range_max(ranges.values, far)
    return float(inside.sum())
