"""What a recorder that does not record one part leaves of a log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from slamreplay.simulate.topics import Record

Edit = Callable[[Sequence[Record]], Sequence[Record]]

_TRUTH = "/slamreplay/reference"
_POSE = "/amcl_pose"


def recorded(part: str | None) -> Edit:
    """What is written of a robot's messages where a part is not recorded; None is all of them.

    The reference is written in no case: robots in the field have none.
    """

    def edit(records: Sequence[Record]) -> Sequence[Record]:
        kept = [r for r in records if r.topic != _TRUTH]
        return kept if part is None else _WITHOUT[part](kept)

    return edit


def _topic(name: str) -> Edit:
    return lambda records: [r for r in records if r.topic != name]


def _topic_and_edge(name: str, parent: str, child: str) -> Edit:
    """Without a topic and without the transforms on tf that say the same."""

    def edit(records: Sequence[Record]) -> Sequence[Record]:
        return [r for r in records if r.topic != name and not _is_edge(r, parent, child)]

    return edit


def _is_edge(record: Record, parent: str, child: str) -> bool:
    if record.topic != "/tf":
        return False
    return all(
        (t.header.frame_id, t.child_frame_id) == (parent, child) for t in record.message.transforms
    )


def _no_covariance(records: Sequence[Record]) -> Sequence[Record]:
    """Poses as drivers send them that fill no covariance in."""
    return [r if r.topic != _POSE else replace(r, message=_of_zeros(r.message)) for r in records]


def _of_zeros(message):  # type: ignore[no-untyped-def]
    return replace(message, pose=replace(message.pose, covariance=np.zeros(36)))


_WITHOUT: dict[str, Edit] = {
    "odometry": _topic_and_edge("/odom", "odom", "base_link"),
    "imu": _topic("/imu"),
    "scans": _topic("/scan"),
    "pose": _topic_and_edge(_POSE, "map", "odom"),
    "covariance": _no_covariance,
    "map": _topic("/map"),
    "costmap": _topic("/local_costmap/costmap"),
    "recovery": _topic("/behavior_tree_log"),
}
