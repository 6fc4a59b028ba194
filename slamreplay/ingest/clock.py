"""Which clock drives the replay.

Header stamps say when something was measured, log times when it was written down. The sensors'
clock is read off one dense, steadily stamped stream; log times are carried over to it with the
offset of that stream, so that messages without a usable stamp find their place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Clock
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times
from slamreplay.ingest.names import is_reference
from slamreplay.ingest.rows import TopicRows

#: Streams whose stamps come from a sensor's driver, in the order of trust.
SENSOR_TABLES = ("scans", "odometry", "imu", "points")
OTHER_TABLES = ("transforms", "poses", "particles")
#: A row farther than this from where its log time puts it was stamped by another clock. Latched
#: and delayed messages stay well below, clocks of another epoch well above.
OTHER_EPOCH_NS = 60 * NS_PER_S
#: Sensors' latencies stay below this: a stream that lies farther off all the time is on another
#: clock.
SKEW_NS = 5 * NS_PER_S
#: Stamps this far ahead of the log time are dated ahead, where others of the same clock are not.
AHEAD_S = 0.1
#: A recorder that is late by this much has stalled; it catches up within so many seconds.
STALL_NS, AROUND = NS_PER_S // 10, 8
#: What has no header: a log time is all it ever had.
UNSTAMPED = frozenset(
    {
        "geometry_msgs/msg/Twist",
        "map_server",
        "ackermann_msgs/msg/AckermannDrive",
        "std_msgs/msg/Float32",
        "std_msgs/msg/Float64",
        "diagnostic_msgs/msg/DiagnosticStatus",
        "dynamic_reconfigure/msg/Config",
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
        "opennav_docking_msgs/action/DockRobot_FeedbackMessage",
    }
)
#: Types of logs that one process wrote line by line as messages came, each topic from one
#: publisher: of two rows the later one is the later one, whatever the stamps say.
IN_ORDER = ("carmen/", "mrclam/")
#: A clock that steps back by more than this while the log goes on is not one to replay on.
JUMP_NS = NS_PER_S


def choose_clock(topics: Sequence[TopicRows]) -> Clock:
    """The clock that most kinds of evidence are stamped with, or the log's own.

    Kinds count before messages: scans and odometry on one clock outvote a fast IMU on another.
    """
    problems: list[str] = []
    sound = []
    for topic in topics:
        if is_reference(topic.topic):  # it only judges: nothing may hang on its being there
            continue
        if topic.table in (*SENSOR_TABLES, *OTHER_TABLES) and len(topic) and not is_static(topic):
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
    offsets = {id(t): float(np.median(_offsets(t) / NS_PER_S)) for t in sound}
    majority = max(ranked, key=lambda t: (*_votes(t, sound, offsets), len(t), t.topic))
    close = [t for t in ranked if abs(offsets[id(t)] - offsets[id(majority)]) < 1.0]
    # The stream with the least delay between stamp and log is nearest to the clocks' true offset,
    # unless it is dated ahead: no message is recorded before it was made.
    close = [t for t in close if offsets[id(t)] <= AHEAD_S] or close
    dense = [t for t in close if 4 * len(t) >= max(len(c) for c in close)]
    chosen = max(dense, key=lambda t: (offsets[id(t)], len(t), t.topic))
    offset = offsets[id(chosen)]
    kind = "header stamps of simulated time" if _is_simulated(chosen) else "header stamps"
    reason = f"{kind}; log times are carried over with {chosen.topic} ({offset:+.3f} s)"
    others = [t for t in ranked if abs(offsets[id(t)] - offset) * NS_PER_S > SKEW_NS]
    problems += [f"{t.topic}: {offsets[id(t)] - offset:+.0f} s off" for t in others]
    if problems:
        reason += f"; not used: {'; '.join(problems)}"
    return Clock(name="sensor", reason=reason, knots=_knots(chosen))


def is_static(topic: TopicRows) -> bool:
    """Whether rows hold at all times, whenever they were stamped."""
    return topic.table == "transforms" and topic.topic.endswith("tf_static")


def _offsets(topic: TopicRows) -> NDArray[np.int64]:
    stamped = topic.t_sensor_ns != NO_STAMP
    return np.asarray((topic.t_sensor_ns - topic.t_log_ns)[stamped])


def _votes(
    topic: TopicRows, among: Sequence[TopicRows], offsets: dict[int, float]
) -> tuple[int, int, bool, int]:
    """Of what is on the same clock as `topic`: kinds of sensors, all kinds, scans, sensors' rows.

    A localizer's topics come second: it may run on another computer than the sensors.
    """
    own = offsets[id(topic)]
    same = [t for t in among if abs(offsets[id(t)] - own) * NS_PER_S < SKEW_NS]
    tables = {t.table for t in same}
    rows = sum(len(t) for t in same if t.table in SENSOR_TABLES)
    return len(tables & {*SENSOR_TABLES}), len(tables), "scans" in tables, rows


def _is_simulated(topic: TopicRows) -> bool:
    """Whether stamps count from zero while the log's time is of this century."""
    epoch = 1_000_000_000 * NS_PER_S
    stamps = topic.t_sensor_ns[topic.t_sensor_ns != NO_STAMP]
    return bool(np.median(stamps) < epoch < np.median(topic.t_log_ns))


def _problem(topic: TopicRows) -> str | None:
    """Why a topic's stamps are no clock, or None."""
    stamped = topic.t_sensor_ns != NO_STAMP
    if not stamped.any():
        return "no header stamps" if topic.type in UNSTAMPED else "header stamps are zero"
    if stamped.mean() < 0.9:
        return f"{int((~stamped).sum())} of {len(topic)} header stamps are zero"
    if len(topic) > 2 and np.ptp(topic.t_sensor_ns[stamped]) == 0:
        return "all header stamps are equal"
    return "header stamps jump" if stamps_jump(topic, stamped) else None


def stamps_jump(topic: TopicRows, usable: NDArray[np.bool_], back_ns: int = JUMP_NS) -> bool:
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

    Seconds in which a recorder stalled lie in a valley of the offset, and are left out. Where
    stamps step back a second may hold more wrong stamps than right ones, a minute does not.
    """
    every_ns = 60 * NS_PER_S if topic.type.startswith(IN_ORDER) else NS_PER_S
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
    return [knot for knot, stalled in zip(knots, _valleys(knots), strict=True) if not stalled]


def _valleys(knots: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """Which knots lie lower than others shortly before and shortly after them.

    The pace is taken out; a clock that was set, or simulated time that was paused, stays there.
    """
    log = np.array([k[0] - knots[0][0] for k in knots], dtype=np.float64)
    offset = np.array([k[1] - k[0] - (knots[0][1] - knots[0][0]) for k in knots], dtype=np.float64)
    if len(knots) > 1:
        offset -= log * float(np.median(np.diff(offset) / np.maximum(np.diff(log), 1.0)))
    around = np.pad(offset, AROUND, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(around, AROUND + 1)
    before, after = windows[: len(offset)].max(axis=1), windows[AROUND:].max(axis=1)
    return np.asarray(offset < np.minimum(before, after) - STALL_NS)
