"""What the robot planned, and what it and its nodes said: plans, costmaps, log lines, the clock."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from slamreplay.export.formats import NotAsRecorded
from slamreplay.export.recorded.selection import Rows
from slamreplay.export.recorded.stream import Composer, Encoded, Stream, groups, header_stamps
from slamreplay.ingest.names import basename, tokens

#: Levels of rosgraph_msgs/Log by those of rcl_interfaces/Log: ROS 1 counts in bits.
_LEVELS = {1: 10, 2: 20, 4: 30, 8: 40, 16: 50}
_BYTE = 255
#: Types of cost grids that are kept as an OccupancyGrid.
_GRIDS = frozenset({"Costmap", "VoxelGrid", "Grid"})


def navigation(rows: Mapping[str, Rows], types: Mapping[str, str], ros: Composer) -> Encoded:
    """Streams of the tables plans, costmaps, costmap_updates, health and clock.

    Args:
        rows: of the tables.
        types: the message type of topics where it is known.
        ros: makes messages.
    """
    streams = [_plans(topic, own, ros) for topic, own in rows["plans"].of_topics().items()]
    streams += [_grids(topic, own, ros) for topic, own in rows["costmaps"].of_topics().items()]
    updates = rows["costmap_updates"].of_topics()
    streams += [_windows(topic, own, ros) for topic, own in updates.items()]
    for topic, own in rows["health"].of_topics().items():
        make = _lines if basename(topic).startswith("rosout") else _states
        streams.append(make(topic, own, ros))
    streams += [_clock(topic, own, ros) for topic, own in rows["clock"].of_topics().items()]
    return Encoded(streams, _told_otherwise(rows, types))


def _told_otherwise(rows: Mapping[str, Rows], types: Mapping[str, str]) -> list[NotAsRecorded]:
    """Topics whose rows are told in a type of their own no more, as far as anybody can know."""
    found = []
    for topic, own in rows["costmaps"].of_topics().items():
        kind = types.get(topic, "").rpartition("/")[2]
        if kind in _GRIDS or "raw" in tokens(basename(topic)):
            found.append(NotAsRecorded(topic, len(own), "told as nav_msgs/OccupancyGrid"))
    for topic, own in rows["health"].of_topics().items():
        if not basename(topic).startswith(("rosout", "diagnostics")):
            found.append(NotAsRecorded(topic, len(own), "told as diagnostic_msgs/DiagnosticArray"))
    return found


def _plans(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)

    def message(i: int) -> Any:
        header = ros.header(stamps[i], t["frame_id"][i])
        poses = [
            ros.make("geometry_msgs/PoseStamped", header=header, pose=pose)
            for pose in ros.planar(t["xyyaw"][i].reshape(-1, 3))
        ]
        return ros.make("nav_msgs/Path", header=header, poses=poses)

    return Stream(topic, "nav_msgs/Path", rows.t_log_ns, message)


def _grids(topic: str, rows: Rows, ros: Composer) -> Stream:
    """An OccupancyGrid that is called a costmap, for nothing else tells it from a map."""
    t, stamps = rows.table, header_stamps(rows.table)
    name = topic if any(w.startswith("costmap") for w in tokens(topic)) else f"{topic}/costmap"

    def message(i: int) -> Any:
        cells = t["cells"][i].reshape(t["height"][i], t["width"][i])
        resolution, origin = float(t["resolution_m"][i]), t["origin_xyyaw"][i]
        return ros.grid(stamps[i], t["frame_id"][i], cells, resolution, origin)

    return Stream(name, "nav_msgs/OccupancyGrid", rows.t_log_ns, message)


def _windows(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)

    def message(i: int) -> Any:
        return ros.make(
            "map_msgs/OccupancyGridUpdate",
            header=ros.header(stamps[i], t["frame_id"][i]),
            data=t["cells"][i],
            **{name: int(t[name][i]) for name in ("x", "y", "width", "height")},
        )

    return Stream(topic, "map_msgs/OccupancyGridUpdate", rows.t_log_ns, message)


def _lines(topic: str, rows: Rows, ros: Composer) -> Stream:
    t, stamps = rows.table, header_stamps(rows.table)

    def message(i: int) -> Any:
        level = int(t["level"][i])
        return ros.make(
            "rcl_interfaces/Log",
            stamp=ros.stamp(stamps[i]),
            level=_LEVELS.get(level, level) & _BYTE,
            name=t["name"][i],
            msg=t["message"][i],
            file="",
            function="",
            line=0,
        )

    return Stream(topic, "rcl_interfaces/Log", rows.t_log_ns, message)


def _states(topic: str, rows: Rows, ros: Composer) -> Stream:
    """Diagnostics, and whatever else told of a state, as diagnostics."""
    t, stamps = rows.table, header_stamps(rows.table)
    found = groups(rows.t_log_ns, stamps)

    def status(row: int) -> Any:
        return ros.make(
            "diagnostic_msgs/DiagnosticStatus",
            level=int(np.clip(t["level"][row], 0, _BYTE)),
            name=t["name"][row],
            message=t["message"][row],
            hardware_id="",
            values=[],
        )

    def message(i: int) -> Any:
        return ros.make(
            "diagnostic_msgs/DiagnosticArray",
            header=ros.header(stamps[found[i][0]], ""),
            status=[status(row) for row in found[i].tolist()],
        )

    t_log_ns = rows.t_log_ns[[g[0] for g in found]]
    return Stream(topic, "diagnostic_msgs/DiagnosticArray", t_log_ns, message)


def _clock(topic: str, rows: Rows, ros: Composer) -> Stream:
    told = rows.table["clock_ns"].tolist()
    return Stream(
        topic, "rosgraph_msgs/Clock", rows.t_log_ns,
        lambda i: ros.make("rosgraph_msgs/Clock", clock=ros.stamp(told[i])),
    )  # fmt: skip
