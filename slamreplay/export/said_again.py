"""Log lines that tell of recoveries and navigations, said again without what else stood in them.

The wording is Nav2's and move_base's own (`slamreplay.ingest.log_lines` has the sources), so that
whoever reads it, ours or another tool, understands the same.
"""

from __future__ import annotations

from collections.abc import Callable

from slamreplay.ingest.log_lines import told_of

#: Lines of navigations, by name and status.
_NAVIGATIONS = {
    ("navigate_to_pose", "running"): "Begin navigating from current location",
    ("navigate_to_pose", "succeeded"): "Goal succeeded",
    ("navigate_to_pose", "failed"): "Goal failed",
    ("navigate_to_pose", "canceled"): "Goal canceled",
    ("move_base", "aborted"): (
        "Aborting because a valid plan could not be found. Even after executing all recovery "
        "behaviors"
    ),
}
_BEHAVIOURS = {
    "running": "Running {}",
    "success": "{} completed successfully",
    "failure": "{} failed",
    "canceled": "Canceling {}",
}


def said_again(node: str, line: str, new_node: str, new_name: Callable[[str], str]) -> str | None:
    """A line that tells the same recovery or navigation; None where the line tells of none.

    Args:
        node: who said it.
        line: what was said.
        new_node: what that node is called now.
        new_name: gives a recovery its other name.
    """
    meant = told_of(node, line)
    if meant is None:
        return None
    name, status = meant[0], meant[1]
    new = (name if meant in _NAVIGATIONS else new_name(name), status)
    lines = [_NAVIGATIONS.get(new, "")]
    if status == "running":
        lines += [f"{new[0]} behavior started", f"Received request to {new[0]}"]
        lines.append(f"{new[0].capitalize()} to unstuck robot")
    lines.append(_BEHAVIOURS.get(status, "{}").format(new[0]))
    return next((text for text in lines if text and told_of(new_node, text) == new), None)
