"""Windows of a grid and the whole grid they belong to."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.ingest.rows import TopicRows


def grid_of(windows: TopicRows) -> str:
    """The topic of the whole grids that windows (one or more) of a topic belong to."""
    return str(windows.columns["grid_topic"][0])


def fitting(grids: TopicRows, windows: TopicRows) -> tuple[TopicRows, list[Loss]]:
    """The windows that lie inside the last whole grid before them, and those that do not, counted.

    Rows of both are in the order of log time: a window is counted in cells of what was published
    last, whatever the stamps say.
    """
    last = np.searchsorted(grids.t_log_ns, windows.t_log_ns, side="right") - 1
    early, grid = last < 0, np.maximum(last, 0)
    own = windows.columns
    inside = (own["x"] >= 0) & (own["y"] >= 0)
    inside &= own["x"] + own["width"] <= grids.columns["width"][grid]
    inside &= own["y"] + own["height"] <= grids.columns["height"][grid]
    inside &= own["frame_id"] == grids.columns["frame_id"][grid]
    odd = int(np.count_nonzero(~early & ~inside))
    losses = []
    if early.any():
        reason = f"windows before the first whole grid of {grids.topic}"
        count = int(np.count_nonzero(early))
        losses.append(Loss(kind="skipped", what=windows.topic, count=count, reason=reason))
    if odd:
        reason = f"windows that do not fit the last whole grid of {grids.topic}"
        losses.append(Loss(kind="lost", what=windows.topic, count=odd, reason=reason))
    return windows.take(np.flatnonzero(~early & inside)), losses
