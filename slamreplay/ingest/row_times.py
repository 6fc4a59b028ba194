"""Each row's time on the clock that drives the replay, and what was wrong with its stamp."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Clock, Loss
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times, in_order
from slamreplay.ingest.clock import (
    IN_ORDER,
    JUMP_NS,
    OTHER_EPOCH_NS,
    SENSOR_TABLES,
    SKEW_NS,
    UNSTAMPED,
    is_static,
    stamps_jump,
)
from slamreplay.ingest.rows import TopicRows

#: Transforms are dated ahead by seconds on some robots; beyond this it is another clock.
TF_SKEW_NS = 15 * NS_PER_S
#: Over such windows the least delay of a stream tells its level: a recorder stalls for seconds.
WINDOW_NS = 10 * NS_PER_S


def row_times(topic: TopicRows, clock: Clock) -> tuple[Times, list[Loss]]:
    """Each row's time on the clock (N,), and what was wrong with its stamps.

    A usable stamp is taken as it is. Rows without one, or with one of another epoch, get their log
    time carried over to the clock.
    """
    from_log = clock.from_log_time(topic.t_log_ns)
    if clock.name == "log":
        return from_log, []
    stamped = topic.t_sensor_ns != NO_STAMP
    if not stamped.any() and topic.type in UNSTAMPED:
        return from_log, []
    away = np.where(stamped, topic.t_sensor_ns - from_log, 0)
    foreign = stamped & (np.abs(away) > OTHER_EPOCH_NS)
    if is_static(topic):
        return np.where(stamped & ~foreign, topic.t_sensor_ns, from_log), []
    foreign |= _skewed(topic, away, stamped)
    losses = []
    if not stamped.all():
        reason = "header stamp is zero, placed by log time"
        losses.append(_repaired(topic, int((~stamped).sum()), reason))
    # Only rows that agree with the clock prove a topic's stamps; one that jumps proves nothing.
    proven = topic.table in (*SENSOR_TABLES, "poses") and not foreign.all()
    back_ns = 0 if topic.type.startswith(IN_ORDER) else JUMP_NS
    if proven and stamps_jump(topic, ~foreign, back_ns):
        reason = "header stamps jump, placed by log time"
        losses.append(_repaired(topic, int(stamped.sum()), reason))
        return from_log, losses
    if foreign.any():
        losses.append(_repaired(topic, int(foreign.sum()), _elsewhere(topic, away, foreign)))
    t_ns = np.where(stamped & ~foreign, topic.t_sensor_ns, from_log)
    if topic.type.startswith(IN_ORDER):
        t_ns, moved = in_order(t_ns)
        if moved.any():
            reason = "header stamps step back, placed between their neighbours"
            losses.append(_repaired(topic, int(moved.sum()), reason))
    return t_ns, losses


def _skewed(
    topic: TopicRows, away: NDArray[np.int64], stamped: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(N,) rows of stretches that lie off the clock all the time, by more than any latency."""
    out = np.zeros(len(topic), dtype=bool)
    if topic.table in SENSOR_TABLES:
        groups, limit = [np.flatnonzero(stamped)], SKEW_NS
    elif topic.table == "transforms":
        children = topic.columns["child_frame"].astype(str)
        groups = [np.flatnonzero(stamped & (children == child)) for child in np.unique(children)]
        limit = TF_SKEW_NS
    else:
        return out
    for rows in groups:
        if not len(rows) or np.abs(away[rows]).max() <= limit:
            continue
        window = (topic.t_log_ns[rows] - topic.t_log_ns[rows[0]]) // WINDOW_NS
        starts = np.flatnonzero(np.append(True, window[1:] != window[:-1]))
        off = np.minimum.reduceat(np.abs(away[rows]), starts) > limit
        out[rows] = np.repeat(off, np.diff(np.append(starts, len(rows))))
    return out


def _elsewhere(topic: TopicRows, away: NDArray[np.int64], foreign: NDArray[np.bool_]) -> str:
    """Why rows that are stamped far from where they were recorded are, in words."""
    seconds = float(np.median(away[foreign])) / NS_PER_S
    kept_back = topic.table not in (*SENSOR_TABLES, "transforms") and not foreign.all()
    if kept_back and (away[foreign] < 0).all():
        return f"stamped {-seconds:.0f} s before it was recorded (kept back), placed by log time"
    return f"stamped by another clock ({seconds:+.0f} s), placed by log time"


def _repaired(topic: TopicRows, count: int, reason: str) -> Loss:
    return Loss(kind="repaired", what=topic.topic, count=count, reason=reason)
