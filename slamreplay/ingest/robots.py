"""Whose topics and frames: one robot of a log that several share."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import UsageError
from slamreplay.ingest.names import is_base_frame, is_odom_frame, is_reference
from slamreplay.ingest.readers.reader import Connection
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.tables import without_prefix

_ODOMETRY = ("nav_msgs/msg/Odometry", "foxglove_msgs/msg/Odometry")
_LASERS = ("sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MultiEchoLaserScan",
           "foxglove_msgs/msg/LaserScan")  # fmt: skip
#: A robot that has one of these of its own does not use one without a namespace.
_ITS_OWN = frozenset({*_ODOMETRY, *_LASERS, "sensor_msgs/msg/Imu"})
#: Topics that all robots share, beside those in a namespace.
_SHARED = frozenset({"tf", "tf_static", "rosout", "rosout_agg", "diagnostics", "diagnostics_agg"})


def refuse_mixture(connections: Sequence[Connection]) -> None:
    """Raise UsageError where several namespaces have both an odometry and a laser of their own.

    A robot's two lasers may well be called /front/scan and /rear/scan: one of both is not enough.
    """
    robots = _robots(connections)
    if len(robots) > 1:
        raise UsageError(
            f"the log holds {len(robots)} robots: {', '.join(robots)}",
            hint=f"choose one, as in --robot {robots[0]}",
        )


def topic_filter(
    connections: Sequence[Connection], robot: str | None
) -> Callable[[str], str | None]:
    """A function that says why a topic is not looked at, None if it is.

    With a robot named, its namespace counts, and what is above it (/tf, /map, /fleet/map) unless
    the robot has the same of its own; and a reference that is named after it (/mocap/robot1/pose).

    Raises:
        UsageError: no topic is in that namespace.
    """
    if robot is None:
        return lambda _topic: None
    name = robot.strip("/")
    own = [c for c in connections if c.topic.startswith(f"/{name}/")]
    if not own:
        known = sorted({space for c in connections for space in _spaces(c.topic)[:2]})
        raise UsageError(
            f"no topic is in the namespace '{name}'",
            where="--robot",
            hint=f"there are: {', '.join(known) or 'none'}",
        )
    above = {"", *_spaces(f"/{name}")}
    parts = {c.topic.removeprefix(f"/{name}/") for c in own}
    types = {c.type for c in own} & _ITS_OWN
    double = {c.topic for c in connections if c.type in types}

    def reason(topic: str) -> str | None:
        space, _, last = topic.strip("/").rpartition("/")
        if topic.startswith(f"/{name}/"):
            return None
        if space not in above:
            mine = is_reference(topic) and name.rpartition("/")[2] in topic.split("/")
            return None if mine else f"not of robot {name}"
        if last not in _SHARED and (last in parts or topic in double):
            return f"robot {name} has its own"
        return None

    return reason


def in_its_frames(topics: Sequence[TopicRows], robot: str) -> tuple[list[TopicRows], list[Loss]]:
    """The topics with frames as the robot alone would call them, and what tf told of others.

    Its namespace, or the last part of that, is taken off; of a /tf that robots share, edges of
    frames in namespaces that hold another odom or base are left out.
    """
    name = robot.strip("/")
    for prefix in dict.fromkeys((name, name.rpartition("/")[2])):
        topics = [without_prefix(t, prefix) for t in topics]
    used = {str(f) for t in topics if t.table != "transforms"
            for c in t.columns if c.endswith("frame_id") for f in set(t.columns[c])}  # fmt: skip
    its_own = {"", *(frame.rpartition("/")[0] for frame in used)}
    edges = [t.columns[c] for t in topics if t.table == "transforms"
             for c in ("parent_frame", "child_frame")]  # fmt: skip
    frames = {str(f) for column in edges for f in set(column)}
    moving = {f.rpartition("/")[0] for f in frames if is_odom_frame(f) or is_base_frame(f)}
    others = sorted(moving - its_own)
    if not others:
        return list(topics), []
    kept, count = [], 0
    for topic in topics:
        if topic.table != "transforms":
            kept.append(topic)
            continue
        foreign = np.zeros(len(topic), dtype=bool)
        for end in ("parent_frame", "child_frame"):
            foreign |= np.array([_is_in(f, others) for f in topic.columns[end]], dtype=bool)
        count += int(foreign.sum())
        kept.append(topic.take(np.flatnonzero(~foreign)))
    reason = f"frames of other robots: {', '.join(others)}"
    return kept, [Loss(kind="skipped", what="tf", count=count, reason=reason)]


def _robots(connections: Sequence[Connection]) -> list[str]:
    """The innermost namespaces with an odometry and a laser in them."""
    types: dict[str, set[str]] = {}
    for connection in connections:
        if connection.type in (*_ODOMETRY, *_LASERS):
            kind = "odometry" if connection.type in _ODOMETRY else "laser"
            for space in _spaces(connection.topic):
                types.setdefault(space, set()).add(kind)
    whole = [space for space, kinds in types.items() if len(kinds) == 2]
    return sorted(s for s in whole if not any(other.startswith(f"{s}/") for other in whole))


def _spaces(topic: str) -> list[str]:
    """Namespaces a topic is in, the outermost first: "/a/b/c" gives "a" and "a/b"."""
    parts = topic.strip("/").split("/")[:-1]
    return ["/".join(parts[: k + 1]) for k in range(len(parts))]


def _is_in(frame: str, spaces: Sequence[str]) -> bool:
    return any(frame.startswith(f"{space}/") for space in spaces)
