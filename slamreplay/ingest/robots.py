"""Whose topics: one robot of a log that several share."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from slamreplay.errors import UsageError
from slamreplay.ingest.names import namespace
from slamreplay.ingest.readers.reader import Connection


def refuse_mixture(connections: Sequence[Connection]) -> None:
    """Raise UsageError where several namespaces have both an odometry and a laser of their own.

    A robot's two lasers may well be called /front/scan and /rear/scan: one of both is not enough.
    """
    spaces: dict[str, set[str]] = {}
    for connection in connections:
        if connection.type in ("nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan"):
            spaces.setdefault(namespace(connection.topic), set()).add(connection.type)
    robots = sorted(name for name, types in spaces.items() if name and len(types) == 2)
    if len(robots) > 1:
        raise UsageError(
            f"the log holds {len(robots)} robots: {', '.join(robots)}",
            hint=f"choose one, as in --robot {robots[0]}",
        )


def topic_filter(topics: Sequence[str], robot: str | None) -> Callable[[str], str | None]:
    """A function that says why a topic is not looked at, None if it is.

    With a robot named, its namespace counts and topics without any (/tf, /map, /clock).

    Raises:
        UsageError: no topic is in that namespace.
    """
    if robot is None:
        return lambda _topic: None
    name = robot.strip("/")
    if not any(topic.startswith(f"/{name}/") for topic in topics):
        known = sorted({namespace(topic) for topic in topics} - {""})
        raise UsageError(
            f"no topic is in the namespace '{name}'",
            where="--robot",
            hint=f"there are: {', '.join(known) or 'none'}",
        )

    def reason(topic: str) -> str | None:
        if topic.startswith(f"/{name}/") or not namespace(topic):
            return None
        return f"not of robot {name}"

    return reason
