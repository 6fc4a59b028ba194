"""Topics as they are played: moved to the table of their role, on the bundle's clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.errors import UsageError
from slamreplay.geometry.times import Times
from slamreplay.ingest.assembly import Assembly
from slamreplay.ingest.rows import TopicRows

_MOVING = ("linear_velocity_xyz", "angular_velocity_xyz")
_POSED = ("frame_id", "child_frame_id", "position_xyz", "orientation_xyzw")


def moved(topic: TopicRows, table: str, *, kind: str = "") -> TopicRows:
    """The topic as rows of another table, where its type can be that.

    Args:
        topic: rows as they were decoded.
        table: "poses", "references", "initial_poses", "commands", "velocities", or the table it
            is in.
        kind: of a reference.

    Raises:
        UsageError: the type cannot fill that table.
    """
    if topic.table == table:
        return topic
    columns: dict[str, Any] = {}
    if {topic.table, table} == {"commands", "velocities"}:
        columns = {name: topic.columns[name] for name in _MOVING}
        if table == "velocities":  # an unstamped twist names no frame: it is the robot's base
            columns["frame_id"] = np.full(len(topic), "", dtype=object)
            columns["twist_covariance"] = np.full((len(topic), 36), np.nan)
        return replace(topic, table=table, columns=columns)
    if topic.table in ("poses", "odometry") and table in ("poses", "references", "initial_poses"):
        covariance = "pose_covariance" if topic.table == "odometry" else "covariance"
        columns = {name: topic.columns[name] for name in _POSED}
        columns["covariance"] = topic.columns[covariance]
    if not columns:
        raise UsageError(f"a {topic.type} cannot fill the table {table}", where=topic.topic)
    if table == "references":
        columns["kind"] = np.full(len(topic), kind, dtype=object)
    elif table == "poses":
        columns["source"] = np.full(len(topic), "topic", dtype=object)
    else:
        del columns["child_frame_id"]
    return replace(topic, table=table, columns=columns)


def build(topics: Sequence[tuple[TopicRows, Times]]) -> dict[str, Assembly]:
    """Tables of all topics, each with its rows' times on the bundle's clock; sorted by time."""
    parts: dict[str, list[tuple[TopicRows, Times]]] = {}
    for topic, t_ns in topics:
        parts.setdefault(topic.table, []).append((topic, t_ns))
    return {name: Assembly.of(found) for name, found in sorted(parts.items())}


def without_prefix(topic: TopicRows, prefix: str) -> TopicRows:
    """Frame names without a robot's namespace ("robot1/odom" gives "odom")."""
    columns: Mapping[str, Any] = {
        name: _stripped(column, prefix) if name.endswith(("frame_id", "_frame")) else column
        for name, column in topic.columns.items()
    }
    return replace(topic, columns=columns)


def _stripped(column: Any, prefix: str) -> Any:
    if isinstance(column, Ragged):
        return column
    out = np.empty(len(column), dtype=object)
    out[:] = [name.removeprefix(f"{prefix}/") for name in column]
    return out
