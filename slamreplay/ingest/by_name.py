"""Types that anybody uses for anything: read only where the topic's name says what it is."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from slamreplay.ingest.names import is_quality
from slamreplay.ingest.readers.reader import Connection

_SCORE = (is_quality, "by its name no localisation score")
#: Message type to what its topic's name must be, and what to say where it is not.
_NAMED: dict[str, tuple[Callable[[str], bool], str]] = {
    "std_msgs/msg/Float32": _SCORE,
    "std_msgs/msg/Float64": _SCORE,
    "geometry_msgs/msg/Vector3Stamped": _SCORE,
    "autoware_internal_debug_msgs/msg/Float32Stamped": _SCORE,
    "tier4_debug_msgs/msg/Float32Stamped": _SCORE,
}


def without_meaning(
    connections: Sequence[Connection], asked_for: Collection[str]
) -> Callable[[str], str | None]:
    """A function that says why a topic is not read, None if it is.

    Args:
        connections: of the log.
        asked_for: topics that the user gave a role.
    """
    reasons: dict[str, str] = {}
    meant = set(asked_for)
    for connection in connections:
        fits, reason = _NAMED.get(connection.type, (lambda _: True, ""))
        if fits(connection.topic):
            meant.add(connection.topic)
        else:
            reasons[connection.topic] = reason
    return lambda topic: None if topic in meant else reasons.get(topic)
