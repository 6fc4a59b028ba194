"""Which action or service a topic belongs to, and whether that is a recovery or a navigation."""

from __future__ import annotations

import re

#: Tree nodes, behaviour plugins and services are called whatever their user likes, so known stems
#: are looked for inside their names.
_RECOVERY = re.compile(
    r"spin|back_?up|wait|drive_?on_?heading|assisted_?teleop|clear.*costmap|clearing|recover|"
    r"reinitiali[sz]e",
    re.IGNORECASE,
)
#: The last parts of an action's topics: of ROS 1, and of ROS 2, where `_action` hides them.
_TOPICS = frozenset({"goal", "feedback", "result", "status", "cancel"})
_CALLS = frozenset({"send_goal", "get_result", "cancel_goal"})


def is_recovery(name: str) -> bool:
    """Whether a tree node, an action or a service is called like a recovery."""
    return bool(_RECOVERY.search(name))


def action_of(topic: str) -> str:
    """The action of a topic without its namespace, "" where the topic is no action's.

    "/robot1/spin/_action/status" and "/robot1/spin/_action/send_goal/_service_event" give "spin",
    "/move_base/status" gives "move_base".
    """
    parts = topic.strip("/").split("/")
    if parts[-1] == "_service_event" and len(parts) > 3 and parts[-2] in _CALLS:
        parts = parts[:-1]
    if len(parts) > 2 and parts[-2] == "_action":
        return parts[-3]
    return parts[-2] if len(parts) > 1 and parts[-1] in _TOPICS else ""


def service_of(topic: str) -> str:
    """The service of an introspection topic: "/a/clear_b/_service_event" gives "clear_b"."""
    name = topic.removesuffix("/_service_event")
    return name.rpartition("/")[2] if name != topic else ""
