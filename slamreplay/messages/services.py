"""Events of services (introspection of ROS 2, since Iron), as recorders describe them.

rosbag2 stores the service's own text, request and response, under the type of its event; the event
that is on the wire is made of both (rosidl, service_msgs/ServiceEventInfo).
"""

from __future__ import annotations

import re

_EVENT = "_Event"
_RULE = "=" * 80
_INFO = (
    "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number\n"
)
#: What rosidl puts into a message that would be empty.
_NOTHING = "uint8 structure_needs_at_least_one_member\n"
_DIVIDER = re.compile(r"^---[ \t]*$", re.MULTILINE)


def as_message(name: str) -> str:
    """The name that parsers of messages know a part of a service or action by: "package/msg/T"."""
    return name.replace("/srv/", "/msg/").replace("/action/", "/msg/")


def event_definition(name: str, text: str) -> str:
    """The definition of an event from that of its service; any other text as it is.

    Args:
        name: type name, "package/srv/Name_Event".
        text: what the recorder says: a message, or request and response divided by "---", then the
            definitions of the types in them.
    """
    own, rule, others = text.partition(f"\n{_RULE}\n")
    parts = _DIVIDER.split(own)
    if not name.endswith(_EVENT) or len(parts) != 2:
        return text
    package, service = name.partition("/")[0], name.rpartition("/")[2].removesuffix(_EVENT)
    request, response = (part.strip() + "\n" if part.strip() else _NOTHING for part in parts)
    event = (
        "service_msgs/ServiceEventInfo info\n"
        f"{package}/{service}_Request[<=1] request\n"
        f"{package}/{service}_Response[<=1] response\n"
    )
    sections = [
        event,
        f"MSG: {package}/{service}_Request\n{request}",
        f"MSG: {package}/{service}_Response\n{response}",
        f"MSG: service_msgs/ServiceEventInfo\n{_INFO}",
    ]
    return f"{_RULE}\n".join(sections + ([others] if rule else []))


#: Type name ("package/msg/Name") to its fields, for logs without definitions.
SERVICES: dict[str, str] = {
    "service_msgs/msg/ServiceEventInfo": _INFO,
    "nav2_msgs/msg/SetInitialPose_Request": "geometry_msgs/PoseWithCovarianceStamped pose\n",
    "nav2_msgs/msg/SetInitialPose_Response": _NOTHING,
    "nav2_msgs/msg/SetInitialPose_Event": (
        "service_msgs/ServiceEventInfo info\n"
        "nav2_msgs/SetInitialPose_Request[<=1] request\n"
        "nav2_msgs/SetInitialPose_Response[<=1] response\n"
    ),
}
