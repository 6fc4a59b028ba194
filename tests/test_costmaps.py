"""Costmaps and maps that come as windows: composed, versioned, cut, and what does not fit told."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.bundle.costmaps import Costmaps
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.cli.inspect import show
from slamreplay.consistency.audits.inspection import inspect
from slamreplay.ingest import map_versions
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
GRID, UPDATE = "nav_msgs/msg/OccupancyGrid", "map_msgs/msg/OccupancyGridUpdate"
COSTMAP, COSTMAP_UPDATE = "nav2_msgs/msg/Costmap", "nav2_msgs/msg/CostmapUpdate"
VOXELS = "nav2_msgs/msg/VoxelGrid"
ODOM, SCAN = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan"
LOCAL = "/local_costmap/costmap"


@pytest.fixture
def drive(logs):
    """Ten seconds of scan and odometry; `add` puts a message of a kind at a time in seconds."""
    return Drive(logs)


class Drive:
    def __init__(self, logs):
        self.logs, self.messages = logs, []
        for step in range(100):
            self.add(
                0.1 * step, "/scan", SCAN, frame="base_link", angle_min=-1.0, angle_increment=0.25,
                range_min=0.1, range_max=9.0, ranges=np.full(8, 2.0, np.float32),
            )  # fmt: skip
            self.add(
                0.1 * step, "/odom", ODOM, frame="odom", child_frame_id="base_link",
                pose__pose__orientation__w=1.0,
            )  # fmt: skip

    def add(self, t_s, topic, kind, frame="odom", stamped=True, **values):
        t_ns = EPOCH + round(t_s * SECOND)
        if stamped:
            values["header__stamp__sec"] = t_ns // SECOND
            values["header__stamp__nanosec"] = t_ns % SECOND
        message = self.logs.make(kind, header__frame_id=frame, **values)
        self.messages.append((topic, kind, message, t_ns))

    def whole(self, t_s, cells, topic=LOCAL, frame="odom", origin=(0.0, 0.0)):
        cells = np.array(cells, dtype=np.int8)
        self.add(
            t_s, topic, GRID, frame, info__resolution=0.5, info__height=cells.shape[0],
            info__width=cells.shape[1], info__origin__position__x=origin[0],
            info__origin__position__y=origin[1], info__origin__orientation__w=1.0,
            data=cells.ravel(),
        )  # fmt: skip

    def window(self, t_s, x, y, cells, topic=f"{LOCAL}_updates", frame="odom", stamped=True):
        cells = np.array(cells, dtype=np.int8)
        self.add(
            t_s, topic, UPDATE, frame, stamped, x=x, y=y, height=cells.shape[0],
            width=cells.shape[1], data=cells.ravel(),
        )  # fmt: skip

    def bundle(self, tmp_path, name="log", **options):
        path = self.logs.write(f"{name}.mcap", sorted(self.messages, key=lambda m: m[3]))
        return ingest([path], tmp_path / f"{name}.bundle", IngestOptions(**options))


def losses(bundle):
    return {(x.kind, x.what, x.reason): x.count for x in bundle.manifest.losses}


def cells_at(bundle, t_s):
    found = Costmaps.of(bundle.view()).at(EPOCH + round(t_s * SECOND))
    return None if found is None else found.grid.cells.tolist()


def test_windows_are_laid_over_the_last_whole_grid_until_the_next(drive, tmp_path):
    drive.window(0.5, 0, 0, [[100]])
    drive.whole(1.0, [[0, 0, 0], [0, 0, 0]])
    drive.window(2.0, 1, 0, [[100], [99]])
    drive.window(3.0, 0, 1, [[-1, 0]], stamped=False)  # nav2 leaves the stamp of windows empty
    drive.window(3.5, 2, 1, [[100, 100]])  # beyond the edge
    drive.whole(4.0, [[7]], origin=(2.0, 1.0))  # another size, rolled on
    drive.window(4.5, 0, 0, [[8]])
    drive.window(4.6, 0, 0, [[9]], frame="map")

    bundle = drive.bundle(tmp_path)

    assert len(bundle.table("costmaps")) == 2
    assert len(bundle.table("costmap_updates")) == 3
    assert cells_at(bundle, 0.9) is None
    assert cells_at(bundle, 1.5) == [[0, 0, 0], [0, 0, 0]]
    assert cells_at(bundle, 2.5) == [[0, 100, 0], [0, 99, 0]]
    assert cells_at(bundle, 3.9) == [[0, 100, 0], [-1, 0, 0]]
    assert cells_at(bundle, 4.2) == [[7]]
    assert cells_at(bundle, 9.0) == [[8]]
    there = Costmaps.of(bundle.view()).at(EPOCH + 9 * SECOND)
    assert there.grid.origin_xyyaw.tolist() == [2.0, 1.0, 0.0]
    assert there.t_ns == EPOCH + round(4.5 * SECOND)
    found, name = losses(bundle), f"{LOCAL}_updates"
    assert found["skipped", name, f"windows before the first whole grid of {LOCAL}"] == 1
    assert found["lost", name, f"windows that do not fit the last whole grid of {LOCAL}"] == 2


def test_raw_costs_and_their_windows_are_scaled_as_costmaps_are(drive, tmp_path):
    topic = "/local_costmap/costmap_raw"
    drive.add(
        1.0, topic, COSTMAP, metadata__resolution=0.5, metadata__size_x=5, metadata__size_y=1,
        metadata__origin__orientation__w=1.0, data=np.array([0, 1, 252, 253, 254], np.uint8),
    )  # fmt: skip
    drive.add(
        2.0, f"{topic}_updates", COSTMAP_UPDATE, x=3, y=0, size_x=2, size_y=1,
        data=np.array([255, 128], np.uint8),
    )  # fmt: skip

    bundle = drive.bundle(tmp_path)

    assert cells_at(bundle, 1.5) == [[0, 1, 98, 99, 100]]
    assert cells_at(bundle, 2.5) == [[0, 1, 98, -1, 50]]


def test_windows_without_any_whole_grid_are_told(drive, tmp_path):
    drive.window(1.0, 0, 0, [[100]], topic="/global_costmap/costmap_updates")

    bundle = drive.bundle(tmp_path)

    assert len(bundle.table("costmap_updates")) == 0
    reason = "windows of /global_costmap/costmap, of which no whole grid is in the log"
    assert losses(bundle)["skipped", "/global_costmap/costmap_updates", reason] == 1
    assert Costmaps.of(bundle.view()) is None


def test_voxels_play_the_costmap_only_where_nothing_better_is_there(drive, tmp_path):
    voxels = {"size_x": 2, "size_y": 1, "size_z": 2, "data": np.array([0x00010003, 0], np.uint32)}
    at = {"resolutions__x": 0.5, "resolutions__y": 0.5, "resolutions__z": 0.2}
    for step in range(3):
        drive.add(1.0 + step, "/local_costmap/voxel_grid", VOXELS, **voxels, **at)
    alone = drive.bundle(tmp_path)
    drive.whole(2.0, [[0, 0]])
    beside = drive.bundle(tmp_path, "beside")

    assert cells_at(alone, 1.5) == [[100, 0]]
    assert beside.manifest.topic_of("costmap") == LOCAL
    assert len(beside.table("costmaps")) == 4


def test_a_part_of_a_log_keeps_the_windows_that_still_hold(drive, tmp_path):
    drive.whole(0.5, [[0, 0]])
    drive.whole(1.0, [[0, 0]])
    drive.window(2.0, 0, 0, [[100]])
    drive.window(7.0, 1, 0, [[99]])

    bundle = drive.bundle(tmp_path, start_s=5.0)

    assert len(bundle.table("costmaps")) == 1
    assert cells_at(bundle, 5.0) == [[100, 0]]
    assert cells_at(bundle, 8.0) == [[100, 99]]


@given(data=st.data())
def test_composing_in_any_order_gives_what_playing_all_messages_gives(data):
    """Against an oracle that plays the log from its start for every question."""
    draw, rng = data.draw, np.random.default_rng(data.draw(st.integers(0, 99)))
    whole, windows, events, size = [], [], [], None
    for t in range(draw(st.integers(1, 12))):
        if size is None or draw(st.booleans()):
            size = draw(st.integers(1, 4)), draw(st.integers(1, 4))
            cells = rng.integers(0, 101, size)
            whole.append((t, 0, 0, cells))
        else:
            y, x = draw(st.integers(0, size[0] - 1)), draw(st.integers(0, size[1] - 1))
            shape = draw(st.integers(1, size[0] - y)), draw(st.integers(1, size[1] - x))
            cells = rng.integers(0, 101, shape)
            windows.append((t, x, y, cells))
        events.append((whole if not windows or windows[-1][0] != t else windows)[-1])
    costmaps = Costmaps(table("costmaps", whole), table("costmap_updates", windows))

    for t in draw(st.lists(st.integers(0, 13), min_size=1, max_size=6)):
        now = None
        for when, x, y, cells in events:
            if when <= t and (when, x, y) == (when, 0, 0) and any(w[0] == when for w in whole):
                now = cells.copy()
            elif when <= t:
                now[y : y + cells.shape[0], x : x + cells.shape[1]] = cells
        assert np.array_equal(costmaps.at(t).grid.cells, now)


def table(name, rows):
    n = len(rows)
    columns = {
        "t_ns": [r[0] for r in rows],
        "t_sensor_ns": [r[0] for r in rows],
        "t_log_ns": [r[0] for r in rows],
        "topic": [name] * n,
        "frame_id": ["odom"] * n,
        "width": [r[3].shape[1] for r in rows],
        "height": [r[3].shape[0] for r in rows],
        "cells": [r[3] for r in rows],
    }
    if name == "costmaps":
        columns |= {"resolution_m": [0.1] * n, "origin_xyyaw": [[0.0, 0.0, 0.0]] * n}
    else:
        columns |= {"x": [r[1] for r in rows], "y": [r[2] for r in rows], "grid_topic": ["g"] * n}
    return Table(TABLES[name], columns)


# --- maps ------------------------------------------------------------------------------------


def test_windows_of_the_map_make_new_versions(drive, tmp_path):
    drive.whole(1.0, [[0, 100], [-1, 0]], "/map", "map")
    drive.window(2.0, 0, 1, [[100, 100]], "/map_updates", "map")
    drive.window(3.0, 0, 1, [[-1, 0]], "/map_updates", "map")  # as it was at first
    drive.window(4.0, 1, 1, [[5]], "/map_updates", "map")
    drive.window(5.0, 1, 1, [[5, 5]], "/map_updates", "map")

    bundle = drive.bundle(tmp_path)

    table, maps = bundle.table("map_updates"), bundle.manifest.maps
    assert table["topic"].tolist() == ["/map", *["/map_updates"] * 3]
    named = [m.version for m in maps]
    assert [named.index(v) for v in table["map_version"]] == [1, 0, 1, 2]
    assert bundle.grid().cells.tolist() == [[0, 100], [-1, 5]]
    assert len(bundle.table("costmap_updates")) == 0
    reason = "windows that do not fit the last whole grid of /map"
    assert losses(bundle)["lost", "/map_updates", reason] == 1


def test_of_many_versions_those_are_kept_that_differ_most(drive, tmp_path, monkeypatch):
    monkeypatch.setattr(map_versions, "MAX_VERSIONS", 4)
    cells = np.full((4, 4), -1, dtype=np.int8)
    for step in range(9):  # a cell a second, and six at once in the middle
        cells.ravel()[: step + 1 + (6 if step > 4 else 0)] = 100 if step == 0 else 0
        drive.whole(0.5 + step, cells, "/map", "map")

    bundle = drive.bundle(tmp_path)

    table = bundle.table("map_updates")
    kept = [m.version for m in bundle.manifest.maps]
    assert len(table) == 9
    assert len(set(table["map_version"])) == 9
    steps = [table["map_version"].tolist().index(v) for v in kept]
    assert steps == [0, 2, 5, 8]
    (left,) = [x for x in bundle.manifest.losses if x.what == "/map"]
    assert (left.kind, left.count) == ("skipped", 9 - len(kept))
    assert "differs by 2 cells at most" in left.reason


def test_a_part_of_a_log_has_the_maps_that_held_in_it(drive, tmp_path):
    for t_s, cell in ((1.0, 0), (5.0, 100), (8.0, -1)):
        drive.whole(t_s, [[0, cell]], "/map", "map")

    bundle = drive.bundle(tmp_path, start_s=3.0, end_s=7.0)

    first, second = bundle.manifest.maps
    assert first.held_ns == [(EPOCH + 3 * SECOND, EPOCH + 5 * SECOND)]
    assert second.held_ns == [(EPOCH + 5 * SECOND, EPOCH + 7 * SECOND)]
    assert bundle.grid().cells.tolist() == [[0, 100]]
    assert bundle.grid(first.version).cells.tolist() == [[0, 0]]
    assert bundle.grid("sha256:none") is None
    said = [[tuple(span) for span in m["held_ns"]] for m in inspect(bundle)["maps"]]
    assert said == [m.held_ns for m in (first, second)]


def test_inspect_says_when_each_map_held(drive, tmp_path, capsys):
    for t_s, cell in ((0.5, 0), (4.0, 100), (6.0, 0)):
        drive.whole(t_s, [[0, cell]], "/map", "map")

    show(inspect(drive.bundle(tmp_path)), as_json=False)

    said = capsys.readouterr().out
    assert "0.0 to 4.0, 6.0 to 9.9" in said
    assert "4.0 to 6.0" in said
