"""Which clock drives the replay, and each row's time on it.

Header stamps say when something was measured, log times when it was written down. The sensors'
clock is read off one dense, steadily stamped stream; log times are carried over to it with the
offset of that stream, so that messages without a usable stamp find their place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Clock, Loss
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times, in_order
from slamreplay.ingest.names import is_reference
from slamreplay.ingest.rows import TopicRows

#: Streams whose stamps come from a sensor's driver, in the order of trust.
SENSOR_TABLES = ("scans", "odometry", "imu", "points")
OTHER_TABLES = ("transforms", "poses", "particles")
#: A row farther than this from where its log time puts it was stamped by another clock. Latched
#: and delayed messages stay well below, clocks of another epoch well above.
OTHER_EPOCH_NS = 60 * NS_PER_S
#: A clock that steps back by more than this while the log goes on is not one to replay on.
JUMP_NS = NS_PER_S


def choose_clock(topics: Sequence[TopicRows]) -> Clock:
    """The clock that most dense sensor streams are stamped with, or the log's own."""
    problems: list[str] = []
    sound = []
    for topic in topics:
        if is_reference(topic.topic):  # it only judges: nothing may hang on its being there
            continue
        if topic.table in (*SENSOR_TABLES, *OTHER_TABLES) and len(topic) and not _static(topic):
            problem = _problem(topic)
            if problem is None:
                sound.append(topic)
            elif topic.table in SENSOR_TABLES:
                problems.append(f"{topic.topic}: {problem}")
    ranked = [t for t in sound if t.table in SENSOR_TABLES] or sound
    if not ranked:
        why = "; ".join(problems) or "no message carries a header stamp"
        return Clock(name="log", reason=f"log times, for header stamps cannot be used ({why})",
                     knots=[])  # fmt: skip
    offsets = {id(t): float(np.median(_offsets(t) / NS_PER_S)) for t in ranked}
    majority = max(ranked, key=lambda t: (_agreeing(t, ranked, offsets), len(t), t.topic))
    close = [t for t in ranked if abs(offsets[id(t)] - offsets[id(majority)]) < 1.0]
    dense = [t for t in close if 4 * len(t) >= max(len(c) for c in close)]
    # The stream with the least delay between stamp and log is nearest to the clocks' true offset.
    chosen = max(dense, key=lambda t: (offsets[id(t)], len(t), t.topic))
    offset = offsets[id(chosen)]
    reason = f"header stamps; log times are carried over with {chosen.topic} ({offset:+.3f} s)"
    if problems:
        reason += f"; not used: {'; '.join(problems)}"
    return Clock(name="sensor", reason=reason, knots=_knots(chosen))


def row_times(topic: TopicRows, clock: Clock) -> tuple[Times, list[Loss]]:
    """Each row's time on the clock (N,), and what was wrong with its stamps.

    A usable stamp is taken as it is. Rows without one, or with one of another epoch, get their log
    time carried over to the clock.
    """
    from_log = clock.from_log_time(topic.t_log_ns)
    if clock.name == "log":
        return from_log, []
    stamped = topic.t_sensor_ns != NO_STAMP
    if not stamped.any() and topic.type in _UNSTAMPED:
        return from_log, []
    away = np.where(stamped, topic.t_sensor_ns - from_log, 0)
    foreign = stamped & (np.abs(away) > OTHER_EPOCH_NS)
    if _static(topic):
        return np.where(stamped & ~foreign, topic.t_sensor_ns, from_log), []
    losses = []
    if not stamped.all():
        reason = "header stamp is zero, placed by log time"
        losses.append(_repaired(topic, int((~stamped).sum()), reason))
    # Only rows that agree with the clock prove a topic's stamps; one that jumps proves nothing.
    back_ns = 0 if topic.type.startswith(_IN_ORDER) else JUMP_NS
    judged = topic.table in (*SENSOR_TABLES, "poses") and not foreign.all()
    if judged and _jumps(topic, ~foreign, back_ns):
        reason = "header stamps jump, placed by log time"
        losses.append(_repaired(topic, int(stamped.sum()), reason))
        return from_log, losses
    if foreign.any():
        seconds = float(np.median(away[foreign])) / NS_PER_S
        reason = f"stamped by another clock ({seconds:+.0f} s), placed by log time"
        losses.append(_repaired(topic, int(foreign.sum()), reason))
    t_ns = np.where(stamped & ~foreign, topic.t_sensor_ns, from_log)
    if topic.type.startswith(_IN_ORDER):
        t_ns, moved = in_order(t_ns)
        if moved.any():
            reason = "header stamps step back, placed between their neighbours"
            losses.append(_repaired(topic, int(moved.sum()), reason))
    return t_ns, losses


#: What has no header: a log time is all it ever had.
_UNSTAMPED = frozenset({"geometry_msgs/msg/Twist", "ackermann_msgs/msg/AckermannDrive",
                        "std_msgs/msg/Float32", "std_msgs/msg/Float64", "map_server",
                        "diagnostic_msgs/msg/DiagnosticStatus", "dynamic_reconfigure/msg/Config",
                        "lifecycle_msgs/msg/TransitionEvent",
                        "rosgraph_msgs/msg/Clock",
                        "action_msgs/msg/GoalStatusArray",
                        "nav2_msgs/msg/CollisionMonitorState",
                        "nav2_msgs/msg/CollisionDetectorState",
                        "nav2_msgs/action/Spin_FeedbackMessage",
                        "nav2_msgs/action/BackUp_FeedbackMessage",
                        "nav2_msgs/action/Wait_FeedbackMessage",
                        "nav2_msgs/action/DriveOnHeading_FeedbackMessage",
                        "nav2_msgs/action/AssistedTeleop_FeedbackMessage",
                        "nav2_msgs/action/DockRobot_FeedbackMessage",
                        "opennav_docking_msgs/action/DockRobot_FeedbackMessage"})  # fmt: skip
#: Types of logs that one process wrote line by line as messages came, each topic from one
#: publisher: of two rows the later one is the later one, whatever the stamps say.
_IN_ORDER = ("carmen/", "mrclam/")


def _static(topic: TopicRows) -> bool:
    return topic.table == "transforms" and topic.topic.endswith("tf_static")


def _repaired(topic: TopicRows, count: int, reason: str) -> Loss:
    return Loss(kind="repaired", what=topic.topic, count=count, reason=reason)


def _offsets(topic: TopicRows) -> NDArray[np.int64]:
    stamped = topic.t_sensor_ns != NO_STAMP
    return np.asarray((topic.t_sensor_ns - topic.t_log_ns)[stamped])


def _agreeing(topic: TopicRows, among: Sequence[TopicRows], offsets: dict[int, float]) -> int:
    """Rows, of all topics, on the same clock as `topic`."""
    own = offsets[id(topic)]
    limit = OTHER_EPOCH_NS / NS_PER_S
    return sum(len(t) for t in among if abs(offsets[id(t)] - own) < limit)


def _problem(topic: TopicRows) -> str | None:
    """Why a topic's stamps are no clock, or None."""
    stamped = topic.t_sensor_ns != NO_STAMP
    if not stamped.any():
        return "no header stamps" if topic.type in _UNSTAMPED else "header stamps are zero"
    if stamped.mean() < 0.9:
        return f"{int((~stamped).sum())} of {len(topic)} header stamps are zero"
    if len(topic) > 2 and np.ptp(topic.t_sensor_ns[stamped]) == 0:
        return "all header stamps are equal"
    return "header stamps jump" if _jumps(topic, stamped) else None


def _jumps(topic: TopicRows, usable: NDArray[np.bool_], back_ns: int = JUMP_NS) -> bool:
    """Whether stamps go back by more than a second (or `back_ns`) in over one row of a hundred.

    Transforms of several publishers are interleaved and latched rows repeat, so a few are normal.
    """
    usable = usable & (topic.t_sensor_ns != NO_STAMP)
    if topic.table == "transforms" or usable.sum() < 2:
        return False
    t_log, t = topic.t_log_ns[usable], topic.t_sensor_ns[usable]
    t = t[_near_line(t_log, t - t_log)]  # one wild stamp ahead makes all later ones look late
    back = np.maximum.accumulate(t) - t > back_ns
    return bool(back.mean() > 0.01)


def _near_line(t_log: Times, offset: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Offsets (N,) of one epoch: near the line through the first and the last fifth's medians.

    The line may slope, for simulated time does not run at the pace of the log's.
    """
    fifth = max(len(t_log) // 5, 1)
    base, origin = int(offset[0]), int(t_log[0])
    y, x = (offset - base).astype(np.float64), (t_log - origin).astype(np.float64)
    x0, y0, x1, y1 = (float(np.median(v)) for v in (x[:fifth], y[:fifth], x[-fifth:], y[-fifth:]))
    line = y0 + (y1 - y0) * (x - x0) / (x1 - x0) if x1 > x0 else np.full(len(x), np.median(y))
    return np.asarray(np.abs(y - line) < OTHER_EPOCH_NS)


def _knots(topic: TopicRows) -> list[tuple[int, int]]:
    """(log time, clock time) about every second: medians over the second, robust to delays.

    Where stamps step back a second may hold more wrong stamps than right ones, a minute does not.
    """
    every_ns = 60 * NS_PER_S if topic.type.startswith(_IN_ORDER) else NS_PER_S
    stamped = topic.t_sensor_ns != NO_STAMP
    t_log = topic.t_log_ns[stamped]
    offset = topic.t_sensor_ns[stamped] - t_log
    near = _near_line(t_log, offset)
    t_log, offset = t_log[near], offset[near]
    part = (t_log - t_log[0]) // every_ns
    starts = np.flatnonzero(np.append(True, part[1:] != part[:-1]))
    knots = []
    for start, end in zip(starts, np.append(starts[1:], len(t_log)), strict=True):
        middle = int(t_log[start] + (t_log[end - 1] - t_log[start]) // 2)
        base = int(offset[start])  # the median of small differences is exact in float64
        knots.append((middle, middle + base + round(float(np.median(offset[start:end] - base)))))
    return knots
