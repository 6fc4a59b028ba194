"""Topics that are not read: types that tell nothing here, and types that need a name that tells.

Anybody sends a plain number or a set of markers for anything; only the topic's name says for what.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from slamreplay.ingest import DECODERS
from slamreplay.ingest.names import is_quality, is_slam_graph
from slamreplay.ingest.readers.reader import Connection

_SCORE = (is_quality, "by its name no localisation score")
#: Message type to what its topic's name must be, and what to say where it is not.
_NAMED: dict[str, tuple[Callable[[str], bool], str]] = {
    "std_msgs/msg/Float32": _SCORE,
    "std_msgs/msg/Float64": _SCORE,
    "geometry_msgs/msg/Vector3Stamped": _SCORE,
    "autoware_internal_debug_msgs/msg/Float32Stamped": _SCORE,
    "tier4_debug_msgs/msg/Float32Stamped": _SCORE,
    "visualization_msgs/msg/MarkerArray": (is_slam_graph, "by its name no SLAM graph"),
}

#: Message types that are known and have no rows, and why.
_NO_ROWS = {
    "apriltag_msgs/msg/AprilTagDetectionArray": (
        "tags without a pose: apriltag_ros puts their poses on tf"
    ),
    "fiducial_msgs/msg/FiducialArray": "corners of tags in an image, without a pose",
    "nav_msgs/msg/MapMetaData": "size and origin of a map, without its cells",
    "cartographer_ros_msgs/msg/SubmapList": "poses of submaps, which tell of no closure",
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
        if connection.type in _NO_ROWS and connection.type not in DECODERS:  # but for a plug-in's
            reasons[connection.topic] = _NO_ROWS[connection.type]
            continue
        fits, reason = _NAMED.get(connection.type, (lambda _: True, ""))
        if fits(connection.topic):
            meant.add(connection.topic)
        else:
            reasons[connection.topic] = reason
    return lambda topic: None if topic in meant else reasons.get(topic)
