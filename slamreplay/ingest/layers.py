"""Topics in the tables of their roles, and the map layer of the bundle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.bundle.role_tables import ROLE_TABLES
from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.cast import Cast
from slamreplay.ingest.grid_updates import fitting, grid_of
from slamreplay.ingest.grids import given_map
from slamreplay.ingest.map_versions import recorded_maps
from slamreplay.ingest.names import is_reference, is_sensed_dock, why_no_dock
from slamreplay.ingest.roles import Choice, is_command, is_costmap, is_estimate, is_initial_pose
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.tables import moved
from slamreplay.maps.grid import OccupancyGrid

#: The simulator's truth; every other topic that is named as one was measured.
SIMULATED_TRUTH = "/slamreplay/reference"


@dataclass
class Layers:
    """What goes into the bundle, and what did not.

    Attributes:
        topics: rows, each in the table of its role.
        grids: source description to map, oldest first.
        choices: role to topic, the map given by the user included.
        sources: files read on top of the log.
        losses: topics without use, maps that were mended.
    """

    topics: list[TopicRows] = field(default_factory=list)
    grids: dict[str, OccupancyGrid] = field(default_factory=dict)
    choices: dict[str, Choice] = field(default_factory=dict)
    sources: list[Source] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)


def lay_out(cast: Cast, map_yaml: Path | None) -> Layers:
    """Every topic in its table; the map from the yaml, else from the log.

    Raises:
        MapError: the map cannot be read.
    """
    layers = Layers(choices=dict(cast.choices))
    table_of = {c.rows.topic: ROLE_TABLES[role] for role, c in cast.choices.items()}
    windows = {grid_of(t): t for t in cast.topics if t.table == "costmap_updates" and len(t)}
    for topic in cast.topics:
        reason = _no_use(topic, cast, table_of, map_yaml)
        if reason is not None:
            loss = Loss(kind="skipped", what=topic.topic, count=topic.messages, reason=reason)
            layers.losses.append(loss)
        elif table_of.get(topic.topic) == "map_updates":
            maps = recorded_maps(topic, windows.get(topic.topic))
            for grid in maps.grids:
                layers.grids[f"{topic.topic} {len(layers.grids) + 1}"] = grid
            layers.topics += maps.updates
            layers.losses += maps.losses
        elif topic.table == "costmap_updates":
            grids = _whole_grids(topic, cast) if len(topic) else None
            if grids is not None and table_of.get(grids.topic) != "map_updates":
                rows, losses = fitting(grids, topic)
                layers.topics.append(rows)
                layers.losses += losses
        else:
            layers.topics.append(_in_its_table(topic, cast, table_of))
    if map_yaml is not None:
        _use_given_map(layers, cast, map_yaml)
    return layers


def _whole_grids(windows: TopicRows, cast: Cast) -> TopicRows | None:
    """The whole grids that windows of a topic belong to, None where the log has none."""
    name = grid_of(windows)
    found = [t for t in cast.topics if t.table == "costmaps" and t.topic == name and len(t)]
    return found[0] if found else None


def _no_use(
    topic: TopicRows, cast: Cast, table_of: Mapping[str, str], map_yaml: Path | None
) -> str | None:
    """Why a topic's rows have no place in the bundle, or None."""
    if topic.topic in table_of:
        if table_of[topic.topic] == "map_updates" and map_yaml is not None:
            return "the map given with --map is used instead"
        return None
    if topic.table == "costmap_updates" and len(topic):
        grids = _whole_grids(topic, cast)
        if grids is None:
            return f"windows of {grid_of(topic)}, of which no whole grid is in the log"
        return _no_use(grids, cast, table_of, map_yaml)
    if topic.table == "costmaps" and not is_costmap(topic):
        return "a grid that is neither the map nor a costmap"
    if topic.table == "points":
        return "another point cloud is used"
    is_belief = is_estimate(topic, cast.frames) or is_initial_pose(topic)
    is_known = is_belief or is_reference(topic.topic) or is_sensed_dock(topic.topic)
    if topic.table == "poses" and not is_known:
        return why_no_dock(topic.topic) or "a pose, but not the robot's in a map"
    return None


def _in_its_table(topic: TopicRows, cast: Cast, table_of: Mapping[str, str]) -> TopicRows:
    table = table_of.get(topic.topic, topic.table)
    # Tags on tf, recoveries told of in log lines, and scans made of a cloud share a topic's name.
    if topic.table in ("transforms", "references", "health", "recoveries", "scans", "points"):
        return topic
    if {topic.table, table} == {"odometry", "velocities"}:  # so does odometry made of velocities
        return topic
    if topic.topic not in table_of and topic.table == "poses" and is_sensed_dock(topic.topic):
        dock = moved(topic, "references", kind="dock")
        child = np.full(len(dock), "dock", dtype=object)
        return replace(dock, columns={**dock.columns, "child_frame_id": child})
    if topic.topic not in table_of and topic.table in ("poses", "odometry"):
        if is_reference(topic.topic):
            table = "references"
        elif is_initial_pose(topic):
            table = "initial_poses"
        elif is_estimate(topic, cast.frames):
            table = "poses"
    if topic.topic not in table_of and is_command(topic):
        table = "commands"
    kind = "simulation" if topic.topic == SIMULATED_TRUTH else "motion_capture"
    return moved(topic, table, kind=kind)


def _use_given_map(layers: Layers, cast: Cast, path: Path) -> None:
    grid, sources, losses = given_map(path, cast.frames.map or "map")
    layers.sources += sources
    layers.losses += losses
    layers.grids = {path.name: grid}
    # It holds from the log's first moment on.
    first = min((int(t.t_log_ns[0]) for t in cast.topics if len(t)), default=0)
    columns = {
        "map_version": np.array([grid.version], dtype=object),
        "frame_id": np.array([grid.frame_id], dtype=object),
    }
    rows = TopicRows(
        path.name, "map_server", 1, "map_updates", columns, np.array([NO_STAMP]), np.array([first])
    )
    layers.topics.append(rows)
    layers.choices["map"] = Choice(rows, "given with --map")
