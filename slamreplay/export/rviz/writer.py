"""The files for RViz, and how to show them."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.errors import UsageError
from slamreplay.export.recorded.stream import Composer
from slamreplay.export.request import Request
from slamreplay.export.rviz.config import rviz_config
from slamreplay.export.rviz.overlays import overlay_files, overlays
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import map_files
from slamreplay.simulate.topics import Record
from slamreplay.simulate.writer import type_store, write_mcap

LOG = "overlays.mcap"
_SPACE = "/slamreplay"
_README = """\
Show all of it (start RViz first, for a player that has ended offers nothing any more):

  rviz2 -d slamreplay.rviz
  ros2 bag play {log}

{what}

Or serve a map or an overlay by itself, here `{name}`:

  ros2 run nav2_map_server map_server --ros-args -r __node:={name}_shown \\
    -p yaml_filename:=$PWD/{name}.yaml -p topic_name:=slamreplay/{name} -p {frame}
  ros2 run nav2_util lifecycle_bringup {name}_shown
"""
_WHAT = {
    "map": "the map that the log was judged in",
    "appeared": "cells where something stands that the map does not have: purple",
    "removed": "mapped walls that are gone: cyan",
    "belief": "where the robot believed to be: orange-red",
    "hindsight": "where it was: light blue",
}


def write_rviz(request: Request, folder: Path) -> None:
    """Write map, overlays, paths, slamreplay.rviz and a README.

    Raises:
        UsageError: there is no map.
    """
    post = request.post
    assert post is not None
    if post.grid is None:
        raise UsageError("there is no map to lay anything over", hint="give the map with --map")
    found = post.hindsight
    grids = {"map": post.grid}
    grids |= overlays(post.grid, None if found is None else found.changes)
    for name, grid in grids.items():
        files = map_files(grid, name) if name == "map" else overlay_files(grid, name)
        for file, content in files.items():
            (folder / file).write_bytes(content)
    tracks = {"belief": post.belief_on_map, "hindsight": None if found is None else found.track}
    paths = {
        name: track.take(track.has_pose & request.holds(track.t_ns))
        for name, track in tracks.items()
        if track is not None
    }
    paths = {name: track for name, track in paths.items() if len(track)}
    store = type_store(2)
    topics = {name: f"{_SPACE}/{name}" for name in (*grids, *paths)}
    records = _records(grids, paths, request.span.start_ns, Composer(store, 2))
    latched = set(topics.values())
    write_mcap(folder / LOG, store, records, library="slamreplay export", latched=latched)
    frame = post.grid.frame_id
    centre, wide_m = _middle(post.grid)
    text = rviz_config(frame, topics, centre, wide_m)
    (folder / "slamreplay.rviz").write_text(text, encoding="utf-8")
    what = "\n".join(f"  {topic}  {_WHAT[name]}" for name, topic in topics.items())
    name = "appeared" if "appeared" in grids else "map"
    quoted = shlex.quote(f"frame_id:={frame}")  # a log's word, in a line to be copied to a shell
    text = _README.format(log=LOG, what=what, name=name, frame=quoted)
    (folder / "README.txt").write_text(text, encoding="utf-8")


def _records(
    grids: dict[str, OccupancyGrid], paths: dict[str, PoseTrack], t_ns: int, ros: Composer
) -> Iterator[Record]:
    """One message each, all of one moment."""
    for name, grid in grids.items():
        shape = (grid.cells, grid.resolution_m, grid.origin_xyyaw)
        message = ros.grid(t_ns, grid.frame_id, *shape)
        yield Record(t_ns, f"{_SPACE}/{name}", "nav_msgs/OccupancyGrid", message)
    for name, track in paths.items():
        poses = [
            ros.make("geometry_msgs/PoseStamped", header=ros.header(t, track.frame_id), pose=pose)
            for t, pose in zip(track.t_ns.tolist(), ros.planar(track.xyyaw), strict=True)
        ]
        header = ros.header(t_ns, track.frame_id)
        message = ros.make("nav_msgs/Path", header=header, poses=poses)
        yield Record(t_ns, f"{_SPACE}/{name}", "nav_msgs/Path", message)


def _middle(grid: OccupancyGrid) -> tuple[tuple[float, float], float]:
    """Centre of what is known of a map and the larger side of its box, m."""
    rows, cols = np.nonzero(grid.cells >= 0)
    if not len(rows):
        rows, cols = np.array([0, grid.cells.shape[0]]), np.array([0, grid.cells.shape[1]])
    corners = np.array([[r, c] for r in (rows.min(), rows.max()) for c in (cols.min(), cols.max())])
    xy = grid.centre_of(corners)
    low, high = xy.min(axis=0), xy.max(axis=0)
    middle = (low + high) / 2.0
    return (float(middle[0]), float(middle[1])), float((high - low).max())
