"""What changed, when, and what only moved through: on made beams of known truth."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pyarrow.parquet as pq
import pytest
import typer
import yaml
from typer.testing import CliRunner

from slamreplay.bundle.freshness import NEVER, Freshness, fresh_enough
from slamreplay.bundle.store import write_bundle
from slamreplay.cli import report
from slamreplay.errors import OutputError
from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, MISS, Beams
from slamreplay.hindsight.changed_beams import NEARER, SILENT, BeamsOnMap, on_map
from slamreplay.hindsight.changes import find_changes
from slamreplay.hindsight.evidence import bins_of_each, end_cells, lattice, marks, passes
from slamreplay.hindsight.occupancy import taken
from slamreplay.hindsight.regions import confidence
from slamreplay.hindsight.standing import nearest_empty, standing, things
from slamreplay.hindsight.veils import veils
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import map_files, read_map
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.field import working_map
from slamreplay.report.freshness_file import freshness_bytes
from slamreplay.report.map_proposal import proposal_files, write_proposal
from slamreplay.testing.synthetic import room_grid, synthetic_bundle

S = 1_000_000_000
BEARINGS = np.arange(0.0, 2.0 * np.pi, np.radians(1.0))
POSE = np.array([5.0, 4.0, 0.2])


def hall() -> OccupancyGrid:
    """10 x 10 m with a rack of 3 x 0.5 m in its upper half; the rack's inside is not mapped."""
    cells = np.zeros((200, 200), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[140:150, 60:120] = 100
    cells[143:147, 63:117] = -1
    return OccupancyGrid(cells, 0.05, np.array([1.0, -2.0, 0.3]))


def without_rack() -> np.ndarray:
    cells = hall().cells.copy()
    cells[140:150, 60:120] = 0
    return cells


def put(cells: np.ndarray, low: tuple[float, float], high: tuple[float, float]) -> np.ndarray:
    cells = cells.copy()
    x0, y0, x1, y1 = (round(v / 0.05) for v in (*low, *high))
    cells[y0:y1, x0:x1] = 100
    return cells


def find(phases, poses=(POSE,), rate_hz=10.0, lost=lambda ranges: ~np.isfinite(ranges), cells=None):
    """Changes in a log of (start in s, end in s, cells) phases, from each of the poses in turn.

    `cells` stand in for those of the hall's map.

    `lost` says of ranges (N, B) which of them give nothing back.
    """
    t_ns, rows, at = [], [], []
    for start_s, end_s, real in phases:
        world = OccupancyGrid(np.where(real < 0, 100, real), 0.05, np.zeros(3))
        reach = [cast_rays(world, pose, BEARINGS, 12.0)[0] for pose in poses]
        times = np.arange(start_s, end_s, 1.0 / rate_hz)
        turn = np.arange(len(times)) * len(poses) // len(times)
        t_ns += np.rint(times * S).astype(np.int64).tolist()
        rows += [reach[k] for k in turn]
        at += [poses[k] for k in turn]
    ranges = np.array(rows)
    kind = np.where(lost(ranges), MISS, HIT).astype(np.int8)
    ranges = np.where(kind == HIT, ranges, 12.0)
    ends = np.stack([ranges * np.cos(BEARINGS), ranges * np.sin(BEARINGS)], axis=-1)
    beams = Beams(np.array(t_ns), ends.astype(np.float32), kind, np.zeros(2))
    grid = hall() if cells is None else replace(hall(), cells=cells)
    return find_changes(grid, working_map(grid), beams, np.array(at), correct_map=True)


def test_hall_as_mapped_has_no_changes():
    found = find([(0, 10, hall().cells)])

    assert found.changed_share.max() == 0.0
    assert found.regions == ()
    assert not found.appeared.any()
    assert not found.removed.any()


def test_pallet_set_down_elsewhere_is_first_seen_when_the_robot_comes_back():
    found = find([(0, 6, hall().cells), (60, 70, put(hall().cells, (7.0, 3.0), (8.2, 3.8)))])

    (region,) = found.regions
    assert region.kind == "appeared"
    assert region.first_seen_ns == 60 * S
    assert region.last_seen_ns >= 69 * S
    assert found.appeared_share[:60].max() == 0.0
    assert found.appeared_share[60:].min() > 0.02


def test_pallet_taken_away_was_there_until_then():
    box = put(hall().cells, (7.0, 3.0), (8.2, 3.8))
    found = find([(0, 8, box), (60, 70, hall().cells)])

    (region,) = found.regions
    assert region.kind == "appeared"
    assert region.last_seen_ns < 8 * S
    assert found.appeared_share[:80].min() > 0.02
    assert found.appeared_share[80:].max() == 0.0


def test_rack_taken_down_elsewhere_is_gone_from_then_on():
    found = find([(0, 8, hall().cells), (60, 70, without_rack())])

    assert {r.kind for r in found.regions} == {"removed"}
    assert min(r.first_seen_ns for r in found.regions) == 60 * S
    assert found.removed_share[:80].max() == 0.0
    assert found.removed_share[80:].min() > 0.05


def test_rack_that_is_gone_goes_with_its_inside_and_its_back():
    found = find([(0, 10, without_rack())])
    rack = np.zeros((200, 200), dtype=bool)
    rack[140:150, 60:120] = True

    assert (found.removed[rack & hall().occupied]).mean() > 0.99
    assert found.opened[rack & (hall().cells < 0)].mean() > 0.99
    assert not (found.removed | found.opened)[~rack].any()


def test_rack_gone_beside_the_robot_is_told_by_a_lidar_that_sees_as_far_elsewhere():
    found = find([(0, 10, without_rack())], lost=lambda ranges: ranges > 5.9)

    assert {r.kind for r in found.regions} == {"removed"}
    assert found.removed_share.min() > 0.05


def test_glass_that_swallows_light_is_not_gone():
    window = (BEARINGS > 1.0) & (BEARINGS < 1.3)
    flicker = np.random.default_rng(3).random((100, len(BEARINGS))) < 0.05

    found = find([(0, 10, hall().cells)], lost=lambda _: window | flicker)

    assert found.regions == ()
    assert found.changed_share.max() == 0.0


@pytest.mark.parametrize("stands_s", [5.0, 12.0])
def test_person_who_stands_a_while_and_walks_on_is_no_change(stands_s):
    def person(x: float) -> np.ndarray:
        return put(hall().cells, (x, 3.2), (x + 0.4, 3.6))

    walk = [(k * 0.4, (k + 1) * 0.4, person(2.0 + 0.4 * k)) for k in range(11)]
    leave = [(s + 4.4 + stands_s, e + 4.4 + stands_s, w) for s, e, w in walk]
    stand = (4.4, 4.4 + stands_s, person(6.4))
    away = [(s, e, np.roll(w, 80, axis=1) * 0 + hall().cells) for s, e, w in leave[-2:]]
    found = find([*walk, stand, *leave[:3], *away])

    assert found.regions == ()
    assert found.changed_share.max() == 0.0


def test_people_who_pass_one_spot_again_and_again_are_no_change():
    """Too often for the spot to be seen empty for as long as somebody is seen on it."""
    phases = [
        (2.0 * k + 0.2 * i, 2.0 * k + 0.2 * (i + 1), put(hall().cells, (x, 1.5), (x + 0.5, 2.0)))
        for k in range(20)
        for i, x in enumerate(np.linspace(2.0, 4.0, 10))
    ]
    found = find(phases)

    assert found.regions == ()
    assert found.changed_share.max() == 0.0


def test_load_that_creeps_along_is_no_change():
    phases = [
        (k * 0.5, (k + 1) * 0.5, put(hall().cells, (1.5 + 0.1 * k, 2.0), (2.5 + 0.1 * k, 2.8)))
        for k in range(60)
    ]
    found = find(phases)

    assert found.regions == ()


def test_rack_elsewhere_is_one_region_that_moved():
    moved = put(without_rack(), (3.2, 5.0), (6.2, 5.5))
    poses = [POSE, np.array([8.5, 6.5, 1.0]), np.array([4.5, 8.5, 0.0])]
    found = find([(0, 30, moved)], poses)

    (region,) = [r for r in found.regions if r.kind == "moved"]
    here = hall().centre_of(np.array([104.0, 94.0]))  # row, column of the new middle
    there = hall().centre_of(np.array([144.0, 90.0]))
    for (x_min, y_min, x_max, y_max), (x, y) in (
        (region.bbox_m, here),
        (region.from_bbox_m, there),
    ):
        assert x_min < x < x_max
        assert y_min < y < y_max
    assert 0.5 < region.confidence <= 1.0


def test_racks_side_by_side_that_are_gone_are_two_regions():
    mapped = put(without_rack(), (3.0, 7.0), (4.4, 7.5))
    mapped = put(mapped, (4.6, 7.0), (6.0, 7.5))
    mapped[148, 91] = 100  # a speck of the map's between them is no region of its own
    found = find([(0, 20, without_rack())], cells=mapped)

    assert [r.kind for r in found.regions] == ["removed", "removed"]
    wide = [r.bbox_m[2] - r.bbox_m[0] for r in found.regions]
    assert max(wide) < 2.0


def test_box_unlike_the_rack_that_is_gone_did_not_move():
    found = find([(0, 20, put(without_rack(), (7.5, 2.0), (8.3, 2.8)))])

    assert {r.kind for r in found.regions} == {"appeared", "removed"}


def test_few_contrary_bins_do_not_flip_a_cell():
    seen = np.array([[1, 1, 1, 1, 0, 1, 1, 1, 0, 0, 0, 0, 0, 0]], dtype=bool)

    assert taken(seen, ~seen).tolist() == [[True] * 8 + [False] * 6]


def test_freshness_says_what_was_confirmed_and_what_contradicted():
    found = find([(0, 6, hall().cells), (60, 70, put(hall().cells, (7.0, 3.0), (8.2, 3.8)))])
    layer = found.freshness
    free, box, wall, behind = hall().centre_of(np.array([[60, 60], [65, 141], [0, 100], [190, 90]]))
    confirmed, contradicted = layer.at([free, box, wall, behind])

    assert confirmed[0] >= 69 * S
    assert contradicted[0] == NEVER
    assert confirmed[1] < 6 * S
    assert contradicted[1] >= 69 * S
    assert confirmed[2] >= 69 * S
    assert (confirmed[3], contradicted[3]) == (NEVER, NEVER)
    assert layer.at([[500.0, 0.0]])[0].tolist() == [NEVER]


def test_only_what_was_confirmed_lately_and_not_contradicted_is_fresh_enough():
    confirmed = np.array([[90, 90, 40, NEVER]]) * np.int64(S)
    confirmed[0, 3] = NEVER
    contradicted = np.array([[NEVER, 95 * S, NEVER, NEVER]])
    layer = Freshness(confirmed, contradicted, 1.0, np.zeros(3), 100 * S)
    way = np.array([[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [3.5, 0.5], [9.0, 0.5]])

    assert fresh_enough(layer, way, 30.0).tolist() == [True, False, False, False, False]
    assert fresh_enough(layer, way, 60.0).tolist() == [True, False, True, False, False]
    assert fresh_enough(layer, way, 60.0, 160 * S).tolist() == [False] * 5
    with pytest.raises(ValueError, match="end"):
        fresh_enough(layer, way, 60.0, 50 * S)


def test_freshness_file_holds_seen_cells_alone_and_never_is_null():
    layer = find([(0, 6, hall().cells)]).freshness
    table = pq.read_table(io.BytesIO(freshness_bytes(layer, frame="map", clock="header stamps")))
    meta = json.loads(table.schema.metadata[b"slamreplay"])

    assert table.num_rows == np.count_nonzero(layer.confirmed_ns != NEVER)
    assert table["contradicted_ns"].null_count == table.num_rows
    assert meta["resolution_m"] == layer.resolution_m
    xy = np.column_stack([table["x_m"], table["y_m"]])
    np.testing.assert_array_equal(layer.at(xy)[0], table["confirmed_ns"].to_numpy())


def changed_hall():
    return find([(0, 20, put(without_rack(), (7.0, 3.0), (8.2, 3.8)))])


def test_proposal_touches_only_what_was_seen_and_keeps_the_map_as_it_was_drawn(tmp_path):
    files = map_files(hall(), "hall")
    meta = {**yaml.safe_load(files["hall.yaml"]), "occupied_thresh": 0.7, "free_thresh": 0.2}
    (tmp_path / "hall.yaml").write_text(yaml.safe_dump(meta))
    old = bytearray(files["hall.pgm"])
    old[-950] = 251  # a shade that another tool left
    (tmp_path / "hall.pgm").write_bytes(bytes(old))
    found = changed_hall()
    target = tmp_path / "new.yaml"
    write_proposal(hall(), found, target, tmp_path / "hall.yaml")

    kept = yaml.safe_load(target.read_text())
    assert {**kept, "image": "hall.pgm"} == meta
    new = read_map(target, warn=pytest.fail)
    touched = new.cells != hall().cells
    assert touched[found.appeared].all()
    assert (new.cells[found.removed] == 0).all()
    assert not (touched & ~(found.appeared | found.removed | found.opened)).any()
    assert (tmp_path / "new.pgm").read_bytes()[-950] == 251


def test_what_was_put_back_during_the_log_is_not_proposed():
    found = find([(0, 8, put(hall().cells, (7.0, 3.0), (8.2, 3.8))), (60, 70, hall().cells)])

    assert found.appeared.any()
    assert proposal_files(hall(), found, "new", None)["new.pgm"] == map_files(hall(), "m")["m.pgm"]


@pytest.mark.parametrize("low", [(3.3, 7.4), (3.4, 6.6), (6.5, 4.0)])
def test_corrected_map_explains_the_log(low):
    high = (low[0] + 3.0, low[1] + 0.5)
    log = [(0, 10, put(without_rack(), low, high))]
    before = find(log)
    after = find(log, cells=before.corrected)

    assert before.changed_share.max() > 0.05
    assert after.changed_share.max() < 0.01
    np.testing.assert_array_equal(after.corrected, before.corrected)


@pytest.mark.parametrize(("came_s", "drawn"), [(4, True), (13, False)])
def test_what_its_place_was_empty_for_longer_than_it_stood_is_not_drawn(came_s, drawn):
    box = put(hall().cells, (7.0, 3.0), (8.2, 3.8))
    found = find([(0, came_s, hall().cells), (came_s, 20, box)])

    assert found.appeared.any()
    assert (found.corrected != hall().cells).any() == drawn


def test_region_is_surer_the_more_often_and_the_more_clearly_it_was_seen():
    assert confidence(1.0, 5) == pytest.approx(6 / 7)
    assert confidence(0.7, 5000) == confidence(1.0, 5000) == 0.99
    assert confidence(0.35, 5000) == pytest.approx(0.5, abs=1e-3)
    assert confidence(0.0, 5000) == 0.0


def test_one_bin_in_which_beams_passed_is_noise():
    empty = np.array([[0, 1, 0, 0, 0], [1, 0, 1, 1, 0], [0, 0, 0, 0, 0]], dtype=bool)

    assert nearest_empty(empty, earlier=True).tolist() == [-np.inf, 2, -np.inf]
    assert nearest_empty(empty, earlier=False).tolist() == [np.inf, 2, np.inf]
    assert nearest_empty(empty[:, :0], earlier=True).tolist() == [-np.inf] * 3


def test_map_that_is_not_ours_is_never_overwritten(tmp_path):
    (tmp_path / "hall.yaml").write_text("image: hall.pgm\n")
    with pytest.raises(OutputError, match="not a proposal of ours"):
        write_proposal(hall(), None, tmp_path / "hall.yaml", None)
    write_proposal(hall(), None, tmp_path / "new.yaml", None)
    write_proposal(hall(), None, tmp_path / "new.yaml", None)  # its own it may replace


def run_report(*arguments):
    program = typer.Typer()
    program.callback()(lambda: None)
    report.register(program)
    return CliRunner().invoke(program, ["report", *map(str, arguments)])


def test_report_refuses_the_place_of_a_map_before_it_reads_the_log(tmp_path):
    (tmp_path / "hall.yaml").write_text("image: hall.pgm\n")
    told = (tmp_path / "no.mcap", "-o", tmp_path / "out", "--update-map", tmp_path / "hall.yaml")
    error = run_report(*told).exception

    assert isinstance(error, OutputError)
    assert "never overwritten" in str(error)


def test_report_writes_the_corrected_map_and_the_freshness_layer(tmp_path):
    bundle = synthetic_bundle(seconds=6.0)
    tables = {name: bundle.table(name) for name in ("scans", "odometry", "transforms", "poses")}
    write_bundle(tmp_path / "b.bundle", bundle.manifest, tables, {"room": room_grid()})
    target = tmp_path / "new.yaml"
    result = run_report(tmp_path / "b.bundle", "-o", tmp_path / "r", "--update-map", target)

    assert result.exit_code == 0, result.output
    new = read_map(target, warn=pytest.fail)
    np.testing.assert_array_equal(new.cells, room_grid().cells)  # nothing had changed
    np.testing.assert_allclose(new.origin_xyyaw, room_grid().origin_xyyaw)
    assert pq.read_table(tmp_path / "r" / "freshness.parquet").num_rows > 1000


def test_corrected_map_of_the_changed_aisle_is_no_longer_changed(tmp_path):
    log = Path(__file__).parents[1] / "sample_logs" / "changed_aisle.mcap"
    target = tmp_path / "new.yaml"
    states = []
    for name, more in (("old", ("--update-map", target)), ("new", ("--map", target))):
        result = run_report(log, "-o", tmp_path / name, *more)
        assert result.exit_code == 0, result.output
        states.append(json.loads((tmp_path / name / "report.json").read_text())["verdict"]["state"])

    assert states == ["map_changed", "healthy"]


def turning_beams(scans: int) -> tuple[Beams, np.ndarray]:
    """Scans of the hall from places along a line, two out of ten without a return."""
    rng = np.random.Generator(np.random.PCG64(8))
    poses = np.linspace([2.0, 2.0, 0.0], [7.0, 5.0, 2.0], scans)
    reach = rng.uniform(0.5, 8.0, (scans, len(BEARINGS)))
    ends = np.stack([reach * np.cos(BEARINGS), reach * np.sin(BEARINGS)], axis=-1)
    kind = np.where(rng.random(reach.shape) < 0.2, MISS, HIT).astype(np.int8)
    poses[5] = np.nan
    return Beams(np.arange(scans) * S // 10, ends.astype(np.float32), kind, np.zeros(2)), poses


def test_threads_change_nothing(monkeypatch):
    beams, poses = turning_beams(700)
    working = working_map(hall())
    found = []

    for threads in (1, 2, 3):
        monkeypatch.setattr(numba, "get_num_threads", lambda threads=threads: threads)
        laid = on_map(working, beams, poses)
        where = lattice(working, beams.t_ns)
        slots = np.arange(where.shape[0] * where.shape[1], dtype=np.int32).reshape(where.shape)
        passed = passes(where, beams, poses, 6.0, slots, slots.size)
        arrays = (laid.says, laid.where, laid.is_sure, laid.wall_m)
        arrays += (passed.through, passed.last, passed.bin_count)
        found.append([a.tobytes() for a in arrays])

    assert (passed.bin_count == passed.through.sum(axis=1).reshape(where.shape)).all()
    assert found[1] == found[0]
    assert found[2] == found[0]


def test_place_is_not_empty_where_beams_end_that_came_over_unmapped_cells():
    where = lattice(working_map(hall()), np.arange(60) * S // 2)
    cell = 40 * where.shape[1] + 40
    says = np.full((60, 1), NEARER, dtype=np.int8)
    says[:20] = SILENT  # unmapped cells lay before it
    at = np.full((60, 1), 80 * where.width + 80, dtype=np.int32)
    laid = BeamsOnMap(says, at, np.zeros((60, 1), dtype=bool), np.zeros((60, 1), dtype=np.float32))
    slots = np.full(where.shape, -1, dtype=np.int32)
    slots.ravel()[cell] = 0
    through = np.ones((1, where.bin_count), dtype=bool)  # along its face

    ended = (np.full(60, cell), where.bins)
    nowhere = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int32))

    assert not standing(where, laid, slots, through, ended).empty.any()
    assert standing(where, laid, slots, through, nowhere).empty.ravel().tolist() == (
        [True] * 19 + [False] * 41
    )


def test_cells_of_ends_equal_their_plain_twin():
    beams, poses = turning_beams(40)
    where = lattice(working_map(hall()), beams.t_ns)
    ends = se2.transform_points(poses, beams.ends)[beams.kind == HIT]
    with np.errstate(invalid="ignore"):
        col, row = np.floor((ends - where.corner_xy) / where.cell_m).T
        inside = (row >= 0) & (row < where.shape[0]) & (col >= 0) & (col < where.shape[1])
    plain = np.where(inside, row * where.shape[1] + col, -1)

    np.testing.assert_array_equal(end_cells(where, beams, poses), plain)
    assert 0.2 < np.mean(plain < 0) < 0.8


def test_marks_and_counts_of_bins_equal_their_plain_twins():
    rng = np.random.Generator(np.random.PCG64(9))
    where = lattice(working_map(hall()), np.arange(100) * S // 4)
    cells = rng.integers(0, 60, 500) * where.shape[1] + rng.integers(0, 30, 500)
    bins = np.sort(rng.integers(0, where.bin_count, 500)).astype(np.int32)
    slots = np.full(where.shape, -1, dtype=np.int32)
    slots[:40, :25] = np.arange(1000).reshape(40, 25)

    count = np.zeros(where.shape, dtype=np.int64)
    for cell, _ in set(zip(cells.tolist(), bins.tolist(), strict=True)):
        count.ravel()[cell] += 1
    seen = np.zeros((1000, where.bin_count), dtype=bool)
    for cell, b in zip(cells.tolist(), bins.tolist(), strict=True):
        row, col = divmod(cell, where.shape[1])
        for r, c in ((0, 0), (0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            if 0 <= row + r < 40 and 0 <= col + c < 25:
                seen[slots[row + r, col + c], b] = True

    np.testing.assert_array_equal(bins_of_each(where, cells, bins), count)
    np.testing.assert_array_equal(marks(where, cells, bins, slots, 1, 1000), seen)


def test_veil_hangs_between_an_edge_and_what_lies_behind():
    """Beams over 3 deg meet a post at 2 m, and a wall at 6 m behind it."""
    bearings = np.radians(np.arange(-5.0, 6.0))
    reach = np.array([6.0, 6.0, 6.0, 4.0, 2.0, 2.0, 2.0, 3.1, 6.0, 6.0, 6.0])
    at_edges = [3, 7]

    def seen(reach, kind):
        ends = np.column_stack([reach * np.cos(bearings), reach * np.sin(bearings)])[None]
        return veils(Beams(np.zeros(1, np.int64), ends.astype(np.float32), kind[None], np.zeros(2)))

    hit = np.full(11, HIT, dtype=np.int8)
    nothing = np.where(reach == 6.0, MISS, HIT).astype(np.int8)
    pole = np.where(np.arange(11) == 5, 2.0, 6.0)
    gap = np.where(np.arange(11) == 5, 6.0, 2.0)

    assert np.flatnonzero(seen(reach, hit)[0]).tolist() == at_edges
    assert np.flatnonzero(seen(reach, nothing)[0]).tolist() == at_edges
    assert not seen(pole, hit).any()  # thin, but in front of all
    assert not seen(gap, hit).any()


def test_thing_is_as_large_as_the_parts_that_stay():
    """A person who stood for 12 s and went, with points that hung about for 4.5 s."""
    where = lattice(working_map(hall()), np.arange(60) * S // 2)
    slots = np.full(where.shape, -1, dtype=np.int32)
    slots[40, 40:55] = np.arange(15)
    hung = np.full(15, 4.5)
    stood = np.where(np.abs(np.arange(15) - 7) < 2, 12.0, 4.5)
    course = np.tile([-np.inf, 0.0, 12.0, 13.0], (15, 1))

    def is_change(seen_s):
        return things(where, slots, seen_s, course, np.ones(15)).all()

    assert not is_change(stood)
    assert is_change(hung)  # as long all over: no person is as wide
