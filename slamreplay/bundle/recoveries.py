"""What kind of recovery a row of the table `recoveries` tells of, and how much its source knows."""

from __future__ import annotations

import re

INFERRED = "inferred"
#: Actions whose goal is where the robot is to drive.
NAVIGATIONS = frozenset({"navigate_to_pose", "navigate_through_poses", "move_base"})

_KINDS = (
    ("clear", re.compile(r"clear|reset", re.IGNORECASE)),
    ("spin", re.compile(r"spin|rotat", re.IGNORECASE)),
    ("backup", re.compile(r"back_?(up|away|off)|revers", re.IGNORECASE)),
    ("wait", re.compile(r"wait", re.IGNORECASE)),
    ("drive", re.compile(r"drive_?on_?heading", re.IGNORECASE)),
    ("teleop", re.compile(r"teleop", re.IGNORECASE)),
    ("relocalize", re.compile(r"reinitiali[sz]e|relocali[sz]e", re.IGNORECASE)),
)


def kind_of_recovery(name: str) -> str:
    """One of clear, spin, backup, wait, drive, teleop, relocalize by its name, "" where unclear."""
    return next((kind for kind, pattern in _KINDS if pattern.search(name)), "")


def tells_of_every_recovery(type_name: str) -> bool:
    """Whether a message type is a navigator's own word, so that what it omits did not happen."""
    name = type_name.rpartition("/")[2]
    wide = ("BehaviorTreeLog", "RecoveryStatus", "NavigateToPose_FeedbackMessage",
            "NavigateThroughPoses_FeedbackMessage")  # fmt: skip
    return name in wide or name.startswith("RecoveryAction")
