"""Layouts of Autoware's stamped numbers, which no type store has.

Sources: tier4/tier4_autoware_msgs, autowarefoundation/autoware_internal_msgs (its successor).
"""

from __future__ import annotations

_STAMPED = "builtin_interfaces/Time stamp\nfloat32 data\n"

#: Type name ("package/msg/Name") to its fields, one per line.
SIGNALS: dict[str, str] = {
    "tier4_debug_msgs/msg/Float32Stamped": _STAMPED,
    "autoware_internal_debug_msgs/msg/Float32Stamped": _STAMPED,
}
