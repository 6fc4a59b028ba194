"""A map that changes inside the log: each moment is judged against the version that held then."""

import json
from dataclasses import replace

import numpy as np
import pytest
from rooms import SECOND, at, boxed, log_of_two_worlds, mapped_until, upstairs

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.hindsight.changed_beams import BeamsOnMap
from slamreplay.hindsight.earlier import LaidOver, on_raster
from slamreplay.hindsight.evidence import Lattice
from slamreplay.hindsight.gone import Gone
from slamreplay.hindsight.mapper import drawn_late, drawn_wrongly
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.hindsight.standing import Standing
from slamreplay.ingest.pipeline import ingest
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.matching.field import WorkingMap, working_map
from slamreplay.postmortem import postmortem
from slamreplay.report.writer import write_report
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import scenario
from slamreplay.simulate.topics import START_NS as LOG_START_NS
from slamreplay.simulate.topics import Record, records
from slamreplay.simulate.worlds import rasterise
from slamreplay.simulate.writer import write_log
from slamreplay.testing.edits import rebuilt, with_maps
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle, true_path
from slamreplay.verdict.clearance import Obstacles
from slamreplay.verdict.judge import judge


def judged(bundle):
    view = bundle.view()
    found = hindsight(view)
    return found, judge(view, recorded_belief(view, found.track.t_ns), found)


def states(judgement, start_ns=START_NS):
    return [
        (i.state, (i.start_ns - start_ns) / SECOND, (i.end_ns - start_ns) / SECOND)
        for i in judgement.intervals
    ]


@pytest.fixture(scope="module")
def box_at_30():
    return log_of_two_worlds(90.0, 30.0, room_grid(), boxed())


@pytest.mark.parametrize("resolution_m", [0.02, 0.05, 0.1])
def test_a_map_on_its_own_raster_is_itself(resolution_m):
    cells = np.where(np.random.default_rng(1).random((60, 80)) < 0.1, 100, 0).astype(np.int8)
    cells[:, 50:] = -1
    grid = OccupancyGrid(cells, resolution_m, np.array([2.0, 1.0, 0.7]))
    working = working_map(grid)

    same = on_raster(grid, working)

    assert np.array_equal(same.walls, working.walls)
    assert np.array_equal(same.unknown, working.unknown)


# --- the three cases of the field ---------------------------------------------------------------


def test_a_box_is_a_change_until_the_map_has_it(box_at_30):
    updated = with_maps(box_at_30, [(at(-5.0), room_grid()), (at(60.0), boxed())])

    _, stale = judged(with_maps(box_at_30, [(at(-5.0), room_grid())]))
    found, judgement = judged(updated)

    changed = [s for s in states(judgement) if s[0] == "map_changed"]
    assert [s for s in states(stale) if s[0] == "map_changed"][-1][2] == 90.0
    assert len(changed) == 1
    assert changed[0][1] > 30.0
    assert changed[0][2] == pytest.approx(60.0, abs=0.2)
    assert {s[0] for s in states(judgement)} == {"healthy", "map_changed"}
    assert not found.parts
    # In the map of the end nothing is wrong; what was wrong before is told with its times.
    assert not found.changes.appeared.any()
    assert not found.changes.removed.any()
    assert [r.kind for r in found.changes.regions] == ["appeared", "appeared"]
    assert all(
        at(30.0) < r.first_seen_ns < r.last_seen_ns < at(60.2) for r in found.changes.regions
    )
    assert "SR-MAP-003" in {f.id for f in judgement.findings}


def test_freshness_is_that_of_the_map_at_the_end(box_at_30):
    updated = with_maps(box_at_30, [(at(-5.0), room_grid()), (at(60.0), boxed())])

    fresh = hindsight(updated.view()).changes.freshness

    face = boxed().centre_of([[130, k] for k in range(62, 78)])
    confirmed, contradicted = fresh.at(face)
    assert (confirmed > contradicted).mean() > 0.5
    assert confirmed.max() > at(60.0)


def test_what_one_version_had_and_the_next_lacks_has_not_moved_there(box_at_30):
    """Two maps that are both wrong: boxes drawn before they stood, wiped out while they did."""
    maps = [(at(-5.0), boxed()), (at(60.0), room_grid())]

    found = hindsight(with_maps(box_at_30, maps).view())

    kinds = [(r.kind, r.first_seen_ns < at(30.0)) for r in found.changes.regions]
    assert sorted(kinds) == [("appeared", False)] * 2 + [("removed", True)] * 2
    assert found.changes.appeared.any()
    assert not found.changes.removed.any()


def test_a_map_that_is_being_drawn_is_judged_as_far_as_it_is_drawn(box_at_30):
    """A mapping run that has not drawn the box until it saw it for the second time."""
    times = [1, 5, 10, 20, 30, 40, 60]
    maps = [(at(t), mapped_until(room_grid() if t < 60 else boxed(), t)) for t in times]
    bundle = with_maps(box_at_30, maps)

    found, judgement = judged(bundle)

    assert len(bundle.view().map_course) == len(times)
    assert not found.parts
    changed = [s for s in states(judgement) if s[0] == "map_changed"]
    assert len(changed) == 1
    assert 30.0 < changed[0][1] < changed[0][2] <= 60.2
    assert {s[0] for s in states(judgement)} == {"healthy", "map_changed"}


def test_what_a_mapper_draws_late_or_wrongly_is_no_change():
    """Four cells that differ from the fifth bin on; the log itself has drawn the first two."""
    where = Lattice((1, 4), 1, 4, 0.1, np.zeros(2), np.arange(10, dtype=np.int32))
    holds = np.tile(np.arange(10) >= 5, (4, 1))
    other = np.zeros((4, 10), dtype=bool)
    other[[1, 3], :5] = True  # before it was otherwise
    other[0, 2] = True  # but here only once, by noise
    slots, none_s = np.arange(4, dtype=np.int32)[None], np.zeros(4)
    fresh = np.array([[True, True, False, False]])
    laid = BeamsOnMap(*(np.zeros((10, 1), dtype=t) for t in (np.int8, np.int32, bool, np.float32)))
    walls = WorkingMap(~np.zeros((1, 4), bool), fresh, 0.1, np.zeros(2), np.zeros(3))
    no_walls = replace(walls, walls=~walls.walls)
    over = LaidOver(laid, laid.is_sure, walls, fresh, fresh, laid.is_sure)
    new = Standing(slots, holds, holds, other, none_s, none_s)
    away = Gone(slots, holds, holds, other, none_s, none_s)

    assert drawn_late(where, walls, over, new).tolist() == [True, False, False, False]
    assert drawn_wrongly(where, no_walls, over, away).tolist() == [True, False, False, False]
    # What the newest map still says is contradicted to this day.
    assert not drawn_late(where, no_walls, over, new).any()
    assert not drawn_wrongly(where, walls, over, away).any()


def test_each_floor_is_judged_in_its_own_map():
    bundle = log_of_two_worlds(80.0, 40.0, room_grid(), upstairs())
    maps = [(at(-5.0), room_grid()), (at(40.0), upstairs())]

    found, judgement = judged(with_maps(bundle, maps))

    assert states(judgement) == [("healthy", 0.0, 80.0)]
    error = np.hypot(*(found.track.xyyaw - true_path((found.track.t_ns - START_NS) / 1e9))[:, :2].T)
    assert found.coverage == 1.0
    assert error.max() < 0.2
    assert [p.stretch.version for p in found.parts] == [g.version for _, g in maps]
    assert np.array_equal(np.unique(found.track.t_ns), found.track.t_ns)
    assert found.changes.appeared.shape == upstairs().cells.shape
    assert "SR-ODO-001" not in {f.id for f in judgement.findings}


def test_a_floor_whose_map_is_wrong_leaves_the_other_one_judged():
    """Upstairs the map of another building was loaded: only there nothing can be said."""
    bundle = log_of_two_worlds(80.0, 40.0, room_grid(), upstairs())
    cells = np.zeros((90, 120), dtype=np.int8)
    cells[::15] = 100
    foreign = OccupancyGrid(cells, 0.05, np.zeros(3))

    _, judgement = judged(with_maps(bundle, [(at(-5.0), room_grid()), (at(40.0), foreign)]))

    first, second = states(judgement)
    assert first == ("healthy", 0.0, 40.0)
    assert second == ("insufficient_data", 40.0, 80.0)
    wrong = [f for f in judgement.findings if f.id == "SR-MAP-WRONG"]
    assert [(f.start_ns, f.end_ns) for f in wrong] == [(at(40.0), at(80.0))]


def test_a_map_that_only_flickers_up_is_passed_over_and_told():
    maps = [(at(-5.0), room_grid()), (at(12.0), upstairs()), (at(15.0), room_grid())]
    bundle = with_maps(synthetic_bundle(seconds=30.0), maps)

    found, judgement = judged(bundle)

    assert states(judgement) == [("healthy", 0.0, 30.0)]
    assert not found.parts
    (told,) = [f for f in judgement.findings if f.id == "SR-MAP-003"]
    assert told.severity == "warning"
    assert "1 of another place held for less than 10 s" in told.message


def test_a_belief_says_nothing_in_the_frame_of_another_map():
    bundle = log_of_two_worlds(80.0, 40.0, room_grid(), upstairs())
    shifted = synthetic_bundle(seconds=80.0, belief_offset_xyyaw=(3.0, 0.0, 0.0), offset_from_s=40)
    tables = {name: shifted.table(name) for name in ("transforms", "poses")}
    lost = rebuilt(bundle, tables)

    same, other = (
        judged(with_maps(lost, [(at(-5.0), room_grid()), (at(40.0), upstairs(frame))]))[1]
        for frame in ("map", "map_2")
    )

    assert [s[0] for s in states(same)] == ["healthy", "lost"]
    assert [s[0] for s in states(other)] == ["healthy"]


# --- what reads the map of a moment -----------------------------------------------------------


def test_clearance_is_to_the_walls_of_the_map_of_that_time():
    bundle = with_maps(synthetic_bundle(), [(at(0.0), room_grid()), (at(10.0), boxed())])
    # One metre to the right of a box that the second map has.
    box_edge = room_grid().origin_xyyaw
    here = se2.compose(box_edge, np.array([36 * 0.05 + 1.0, 68 * 0.05, 0.0]))
    t_ns = np.array([at(5.0), at(15.0)])
    belief = PoseTrack("map", "base_link", t_ns, np.array([here, here]), np.zeros((2, 3, 3)))
    obstacles = Obstacles(bundle.view(), belief, 0.25)

    before, after = (obstacles.clearance(int(t)).metres for t in t_ns)

    assert after == pytest.approx(1.0 - 0.25, abs=0.05)
    assert before > after + 0.5


def test_the_report_tells_in_which_map_it_is_drawn(box_at_30, tmp_path):
    floors = log_of_two_worlds(80.0, 40.0, boxed(), upstairs())
    bundle = with_maps(floors, [(at(-5.0), room_grid()), (at(40.0), upstairs())])

    write_report(postmortem(bundle), tmp_path / "report")

    report = json.loads((tmp_path / "report" / "report.json").read_text())
    assert report["bundle"]["map_version"] == upstairs().version
    assert {r["map_version"] for r in report["changed_regions"]} == {room_grid().version}
    page = (tmp_path / "report" / "report.html").read_text().replace("\N{NO-BREAK SPACE}", " ")
    assert "which held from 40.0 s on" in page
    assert "Until 40.0 s the log is in another map and not in this figure" in page


def test_from_the_log_to_the_verdict(tmp_path):
    """A simulated log of an aisle that had changed; at 30 s the map server gets the new map."""
    made = record(scenario("changed_aisle"))
    known = made.logged_map
    new = rasterise(made.scenario.standing, known.resolution_m, as_map=True)
    switch_ns = LOG_START_NS + 30 * SECOND

    def with_switch(messages):
        grid = messages.grid(switch_ns, "map", new.cells, new.resolution_m, new.origin_xyyaw)
        switch = Record(switch_ns + 5_000_000, "/map", "nav_msgs/OccupancyGrid", grid)
        return sorted([*records(made, messages), switch], key=lambda r: r.t_log_ns)

    write_log(tmp_path / "log.mcap", with_switch)
    bundle = ingest([tmp_path / "log.mcap"], tmp_path / "bundle")
    post = postmortem(bundle)

    first, second = bundle.manifest.maps
    assert first.held_ns == [(bundle.manifest.start_ns, switch_ns)]
    assert second.held_ns == [(switch_ns, bundle.manifest.end_ns)]
    changed = [s for s in states(post.judgement, LOG_START_NS) if s[0] == "map_changed"]
    assert changed
    assert changed[-1][2] == pytest.approx(30.0, abs=1.0)
    assert post.grid.version == second.version
    versions = {a.belief.map_version: a.t_ns for a in post.judgement.actions if a.belief}
    assert versions[first.version] < switch_ns <= versions[second.version]
