"""Recoveries that nobody recorded: what is taken for one, what is not, and how little it counts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns
from slamreplay.ingest.inferred_clearing import clearings
from slamreplay.ingest.inferred_motion import manoeuvres
from slamreplay.ingest.pipeline import ingest
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import scenario
from slamreplay.simulate.topics import records
from slamreplay.simulate.writer import write_log

#: Phases are (seconds, forward m/s, sideways m/s, turn rad/s).
DRIVE, REST = (4.0, 0.5, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0)
SPIN, BACK = (2.0, 0.0, 0.0, 0.8), (3.0, -0.1, 0.0, 0.0)


def driven(*phases, rate_hz=25, noise=0.0):
    """The track of a robot that goes through phases."""
    twists = np.vstack([np.tile(p[1:], (round(p[0] * rate_hz), 1)) for p in phases])
    pose = np.zeros((len(twists) + 1, 3))
    for k, twist in enumerate(twists):
        pose[k + 1] = se2.compose(pose[k], twist / rate_hz)
    pose += np.random.default_rng(1).normal(scale=noise or 1e-12, size=pose.shape)
    t = np.rint(np.arange(len(pose)) * 1e9 / rate_hz).astype(np.int64)
    return PoseTrack.without_covariance("odom", "base_link", t, pose)


def commanded(*phases, rate_hz=10):
    twists = np.vstack([np.tile(p[1:], (round(p[0] * rate_hz), 1)) for p in phases])
    t = np.arange(len(twists)) * 10**9 // rate_hz
    zero = np.zeros(len(t))
    columns = {
        "linear_velocity_xyz": np.column_stack([twists[:, :2], zero]),
        "angular_velocity_xyz": np.column_stack([zero, zero, twists[:, 2]]),
    }
    times = dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), t)
    return Table(TABLES["commands"], {**times, "topic": ["/cmd_vel"] * len(t), **columns})


def inferred(*phases, commands=None, at_goal=None, **track):
    found = manoeuvres(driven(*phases, **track), commands, lambda _t_ns: at_goal)
    return [(m.kind, m.start_ns / 1e9) for m in found]


def test_a_spin_and_a_backup_after_a_stop():
    found = inferred(DRIVE, REST, SPIN, REST, BACK, REST, DRIVE)

    assert [kind for kind, _ in found] == ["spin", "backup"]
    assert [t for _, t in found] == pytest.approx([6.0, 10.0], abs=0.3)


@pytest.mark.parametrize("noise", [0.0005, 0.001])
def test_noise_of_encoders_changes_nothing(noise):
    found = inferred(DRIVE, REST, SPIN, REST, BACK, REST, noise=noise)

    assert [kind for kind, _ in found] == ["spin", "backup"]


@pytest.mark.parametrize(
    ("phases", "why"),
    [
        ((REST, SPIN, REST, BACK, REST), "it has not driven yet"),
        ((DRIVE, SPIN, REST), "it did not rest before"),
        ((DRIVE, REST, SPIN, DRIVE), "it turns to where its path leads"),
        ((DRIVE, REST, (1.0, 0, 0, 0.8), REST), "it turns by 0.8 rad only"),
        ((DRIVE, REST, (2.0, 0.2, 0, 0.8), REST), "it drives an arc"),
        ((DRIVE, REST, (1.5, 0, 0, 0.8), (1.5, 0, 0, -0.8), REST), "it looks about"),
        ((DRIVE, REST, (6.0, -0.1, 0, 0), REST), "it drives 0.6 m backwards"),
        ((DRIVE, REST, (0.4, -0.05, 0, 0), REST), "it rolls back by 2 cm"),
        ((DRIVE, BACK, REST), "it did not rest before"),
        ((DRIVE, REST, DRIVE, REST), "it drives on"),
    ],
)
def test_other_motions_are_no_recoveries(phases, why):
    assert inferred(*phases) == [], why


def test_a_turn_that_is_taken_back_is_no_spin():
    back = (1.0, 0.0, 0.0, -0.5)

    assert inferred(DRIVE, REST, (3.0, 0.0, 0.0, 0.8), back, REST, rate_hz=10) == []


def test_a_robot_at_its_goal_turns_to_the_heading_it_was_asked_for():
    short_rest = (0.4, 0.0, 0.0, 0.0)

    assert inferred(DRIVE, REST, SPIN, REST, at_goal=True) == []
    assert inferred(DRIVE, short_rest, SPIN, REST) == []
    assert [k for k, _ in inferred(DRIVE, short_rest, SPIN, REST, at_goal=False)] == ["spin"]


def test_what_commands_contradict_was_no_behaviour():
    phases = (DRIVE, REST, SPIN, REST, BACK, REST)
    pushed = commanded(DRIVE, (11.0, 0.0, 0.0, 0.0))
    silent = commanded(DRIVE)

    assert len(inferred(*phases, commands=commanded(*phases))) == 2
    assert inferred(*phases, commands=pushed) == []
    assert len(inferred(*phases, commands=silent)) == 2


def test_a_gap_in_the_odometry_is_no_rest():
    track = driven(DRIVE, REST, SPIN, REST)
    t_s = track.t_ns / 1e9
    gone = track.take(np.flatnonzero((t_s < 4.5) | (t_s > 5.5)))

    assert manoeuvres(gone, None, lambda _t_ns: None) == ()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.sampled_from([DRIVE, REST, SPIN, BACK, (1.0, 0.1, 0.1, 0.3)]), max_size=8))
def test_manoeuvres_come_in_time_order_inside_the_track(phases):
    track = driven(REST, *phases)
    found = manoeuvres(track, None, lambda _t_ns: None)

    assert [m.start_ns for m in found] == sorted(m.start_ns for m in found)
    assert all(track.t_ns[0] <= m.start_ns < m.end_ns <= track.t_ns[-1] for m in found)


# --- costmaps -------------------------------------------------------------------------------


def costmaps(*grids, seconds=None, origins=None, topic="/local_costmap/costmap"):
    n = len(grids)
    t = np.array([ns(s) for s in (seconds or range(n))], dtype=np.int64)
    columns = {
        "topic": [topic] * n,
        "frame_id": ["odom"] * n,
        "resolution_m": [0.05] * n,
        "width": [g.shape[1] for g in grids],
        "height": [g.shape[0] for g in grids],
        "origin_xyyaw": origins if origins is not None else [[0.0, 0.0, 0.0]] * n,
        "cells": [g.ravel() for g in grids],
    }
    return Table(TABLES["costmaps"], {"t_ns": t, "t_sensor_ns": t, "t_log_ns": t, **columns})


def walls():
    """Lethal cells all around a window of 3 m."""
    grid = np.zeros((60, 60), dtype=np.int8)
    grid[[5, 54], 5:55] = grid[5:55, [5, 54]] = 100
    return grid


def people(*centres):
    """What a lidar in the middle sees of people: arcs of 15 cells."""
    grid = np.zeros((60, 60), dtype=np.int8)
    for row, column in centres:
        grid[row : row + 5, column : column + 3] = 100
    return grid


FREE = np.zeros((60, 60), dtype=np.int8)


def test_a_costmap_whose_lethal_cells_are_gone_was_cleared():
    found = clearings([costmaps(walls(), walls(), FREE, walls())])

    assert found == [(2 * 10**9, "/local_costmap/costmap", 2 * 10**9)]


def test_people_who_walk_off_clear_nothing():
    one, three = people((10, 10)), people((10, 10), (45, 10), (10, 45))
    wall = walls()
    wall[10:15, 10:13] = 100

    assert clearings([costmaps(one, FREE)]) == []
    assert clearings([costmaps(three, FREE)]) == []
    assert clearings([costmaps(wall, walls())]) == []


def test_a_wall_that_goes_on_one_side_is_a_door_and_no_clearing():
    grid = np.zeros((60, 60), dtype=np.int8)
    grid[2:5, :] = 100

    assert clearings([costmaps(grid, FREE)]) == []


@pytest.mark.parametrize(
    "table",
    [
        costmaps(walls(), FREE, seconds=(0, 6)),
        costmaps(walls(), FREE[:40, :40]),
        costmaps(walls(), FREE, origins=[[0, 0, 0], [2.0, 0, 0]]),
    ],
    ids=["6 s later", "another extent", "another place"],
)
def test_costmaps_of_other_times_and_places_are_not_compared(table):
    assert clearings([table]) == []


def test_a_window_that_rolls_on_is_compared_where_both_are():
    moved = np.roll(walls(), (-4, -10), axis=(0, 1))
    origins = [[0.0, 0.0, 0.0], [0.5, 0.2, 0.0]]

    assert clearings([costmaps(walls(), moved, origins=origins)]) == []
    assert len(clearings([costmaps(walls(), FREE, origins=origins)])) == 1


def test_a_table_read_in_parts_is_one():
    table = costmaps(walls(), walls(), FREE, walls())

    for at in (1, 2, 3):
        parts = [table.take(np.arange(at)), table.take(np.arange(at, 4))]
        assert clearings(parts) == clearings([table])


# --- whole logs -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def blocked(tmp_path_factory):
    """A simulated log with recoveries, its bundle, and the bundle of the log without its tree."""
    folder = tmp_path_factory.mktemp("inferred")
    recording = record(scenario("changed_aisle"))
    bundles = []
    for name, hidden in (("told", ()), ("silent", ("/behavior_tree_log",))):
        path = folder / f"{name}.mcap"
        write_log(path, lambda m, hidden=hidden: [
            r for r in records(recording, m) if r.topic not in hidden
        ])  # fmt: skip
        bundles.append(ingest([path], folder / name))
    return bundles


def begun(bundle, names):
    table = bundle.table("recoveries")
    keep = np.isin(table["name"].astype(str), names) & (table["status"] == "running")
    return table.take(keep)


def test_what_the_tree_told_is_inferred_without_it(blocked):
    told, silent = blocked
    truth, found = begun(told, ["Spin", "BackUp"]), begun(silent, ["spin", "backup"])

    assert len(found) == len(truth) > 0
    assert found.t_ns.tolist() == pytest.approx(truth.t_ns.tolist(), abs=ns(0.5))
    assert set(found["source"]) == {"inferred"}
    assert set(found["topic"]) == {"/odom"}
    assert (np.abs(found["t_log_ns"] - found.t_ns) < ns(0.1)).all()


def test_nothing_is_inferred_where_a_navigator_speaks(blocked):
    told, _ = blocked

    assert "inferred" not in set(told.table("recoveries")["source"])


def test_what_is_inferred_is_not_recorded(blocked):
    _, silent = blocked

    assert silent.manifest.topic_of("recovery") is None
    assert [m.consequence for m in silent.manifest.missing if m.part == "recovery"] == [
        "recoveries can only be inferred from motion and costmaps"
    ]
