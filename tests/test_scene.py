"""What there was to see at each moment: scans, beam classes, particles, plans, marks and lanes."""

from dataclasses import replace

import numpy as np
import pytest
from beam_truth import UNASKED, truth_of_beams
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.stats import chi2

from slamreplay.bundle.manifest import Role
from slamreplay.bundle.met import BeamsMet
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.view import Bundle
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.evidence.scene import Met
from slamreplay.evidence.scene_lanes import largest_sigma
from slamreplay.evidence.scene_marks import scene_marks
from slamreplay.evidence.scene_of import scene_of
from slamreplay.evidence.scene_scans import chosen
from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, INVALID, Beams
from slamreplay.hindsight.changed_beams import BEYOND, MET, NEARER, SILENT, BeamsOnMap
from slamreplay.hindsight.evidence import Lattice, Passes
from slamreplay.hindsight.met import TOGETHER_M, has_neighbour, passing, what_was_met
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.hindsight.standing import Standing
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.postmortem import postmortem
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.drive import Follow, Pause
from slamreplay.simulate.people import Walker
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import Lidar
from slamreplay.simulate.worlds import box, warehouse
from slamreplay.testing.edits import rebuilt, with_maps, with_repeated_stamps, without
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle
from slamreplay.testing.synthetic_rows import ns_of
from slamreplay.verdict.judgement import ConstantOffset, Interval


def room_with_a_box() -> OccupancyGrid:
    """The synthetic room with something set down that the map lacks."""
    grid = room_grid()
    cells = grid.cells.copy()
    cells[60:70, 40:56] = 100
    return OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw)


@pytest.fixture(scope="module")
def boxed():
    bundle = synthetic_bundle(
        seconds=12.0,
        world=room_with_a_box(),
        belief_offset_xyyaw=(1.5, 0.5, 0.1),
        offset_from_s=5.0,
    )
    return bundle.view(), postmortem(bundle, cause=False)


def assert_shares(scans, changes):
    """The share of beams that the verdict counts is that of the beams classed so."""
    valid = np.count_nonzero(scans.met != Met.INVALID, axis=1)
    changed = np.isin(scans.met, (Met.APPEARED, Met.REMOVED)).sum(axis=1)
    assert np.array_equal(scans.t_ns, changes.t_ns)
    assert np.array_equal(changed / valid, changes.changed_share)


def test_changed_share_is_the_share_of_beams_classed_so(boxed):
    _, post = boxed
    (scans,), changes = post.scene.scans, post.hindsight.changes

    assert np.count_nonzero(scans.met == Met.APPEARED) > 200
    assert_shares(scans, changes)


def test_marks_stand_in_time_order_and_tell_when_the_robot_was_lost(boxed):
    _, post = boxed
    marks = post.scene.marks

    (lost,) = [m for m in marks if m.kind == "lost"]
    assert [m.t_ns for m in marks] == sorted(m.t_ns for m in marks)
    assert post.seconds(lost.t_ns) == pytest.approx(5.0, abs=0.5)
    assert {"lost", "jump", "start", "finding"} <= {m.kind for m in marks}


def test_stretches_that_follow_each_other_are_one(boxed):
    view, post = boxed
    states = ("healthy", "lost", "lost_and_map_changed", "map_changed", "healthy", "lost")
    tiles = tuple(Interval(s, 10 * k, 10 * (k + 1)) for k, s in enumerate(states))
    other = replace(post, judgement=replace(post.judgement, intervals=tiles))

    spans = [(m.kind, m.t_ns, m.end_ns) for m in scene_marks(other, view) if m.end_ns is not None]

    assert [s for s in spans if s[0] == "lost"] == [("lost", 10, 30), ("lost", 50, 60)]
    assert [s for s in spans if s[0] == "map_changed"] == [("map_changed", 20, 40)]


def test_lanes_are_as_long_as_their_times_and_carry_the_verdicts_limits(boxed):
    _, post = boxed
    lanes = {lane.key: lane for lane in post.scene.lanes}

    assert set(lanes) == {"error_m", "error_deg", "sigma_m", "nees", "changed_share", "match"}
    assert all(len(lane.t_ns) == len(lane.values) for lane in lanes.values())
    assert np.array_equal(lanes["error_m"].values, post.error.distance_m, equal_nan=True)
    assert lanes["error_m"].limit == post.limits.position_m
    heading = np.degrees(post.error.heading_rad)
    assert np.array_equal(lanes["error_deg"].values, heading, equal_nan=True)
    assert lanes["error_deg"].limit == pytest.approx(np.degrees(post.limits.yaw_rad))
    axes = [np.sqrt(np.linalg.svd(c[:2, :2])[1][0]) for c in post.belief.cov]
    assert lanes["sigma_m"].values == pytest.approx(np.array(axes))
    assert lanes["nees"].limit == pytest.approx(chi2.ppf(0.99, 3))
    assert lanes["changed_share"].limit == post.limits.changed_share
    assert "3 dof" in lanes["nees"].title


def test_fewer_scans_are_shown_but_the_first_the_last_and_those_around_what_happened(boxed):
    view, post = boxed
    (few,) = scene_of(post, view, most_scans=24).scans
    (every,) = scene_of(post, view, most_scans=None).scans
    (lost,) = [m for m in post.scene.marks if m.kind == "lost"]

    assert len(every.t_ns) == 120
    assert len(few.t_ns) <= 24
    assert (few.t_ns[0], few.t_ns[-1]) == (every.t_ns[0], every.t_ns[-1])
    rows = np.searchsorted(every.t_ns, few.t_ns)
    for name in ("ends_m", "is_hit", "met"):
        assert np.array_equal(getattr(few, name), getattr(every, name)[rows])
    assert np.abs(few.t_ns - lost.t_ns).min() <= 200_000_000


# --- beams -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def told():
    """Two lasers pass a rack that is gone, a box that was set down, and people; and the truth."""
    mapped = warehouse()
    pallet = box("pallet", 6.6, 4.3, 1.0, 1.2)
    people = (Walker(((9.0, 5.1), (14.5, 5.2))), Walker(((16.5, 1.0), (16.9, 8.2))))
    story = Scenario(
        mapped,
        mapped.changed(without=("rack a2",), added=(pallet,)),
        (15.0, 4.6, np.pi),
        (Pause(1.0), Follow(((9.4, 4.6),)), Pause(2.0)),
        "map_changed",
        1,
        walkers=people,
        lidar=Lidar(beams=181),
        rear=Lidar(beams=161),
        amcl=AmclConfig(min_particles=50, max_particles=100),
    )
    recording = record(story)
    return recording, bundle_of(recording).view()


def test_beams_are_classed_by_what_they_met(told):
    recording, view = told
    found = hindsight(view)
    truth = {t_ns[0]: (t_ns, met) for t_ns, met in truth_of_beams(recording)}
    confusion = np.zeros((len(Met), len(Met)), dtype=int)

    assert len(found.changes.met) == 2
    for one in found.changes.met:
        t_ns, met = truth.pop(one.t_ns[0])
        assert np.array_equal(t_ns, one.t_ns)
        asked = met != UNASKED
        np.add.at(confusion, (met[asked], one.met[asked]), 1)

    right = np.diagonal(confusion)
    assert confusion.sum(axis=1)[: Met.OTHER].min() > 50
    for code, recall, precision in (
        (Met.INVALID, 1.0, 1.0),
        (Met.MAPPED, 0.98, 0.99),
        (Met.APPEARED, 0.95, 0.99),
        (Met.REMOVED, 0.95, 0.98),
        (Met.MOVING, 0.95, 0.99),
    ):
        assert right[code] >= recall * confusion[code].sum(), code.name
        assert right[code] >= precision * confusion[:, code].sum(), code.name


def test_both_lasers_are_shown_at_the_same_moments(told):
    _, view = told
    post = postmortem(view.bundle, cause=False, scene=False)
    first, second = scene_of(post, view, most_scans=10).scans

    assert post.scene is None
    assert len(first.t_ns) == 10
    assert np.abs(second.t_ns[:, None] - first.t_ns).min(axis=1).max() < 100_000_000
    assert {first.met.shape[1], second.met.shape[1]} == {181, 161}
    assert np.abs(first.laser_xy - second.laser_xy).max() > 0.2


def test_nothing_is_said_of_beams_from_where_nobody_knows_the_robot_was():
    t_ns = START_NS + np.arange(4)
    one = BeamsMet(t_ns[:2], np.full((2, 3), Met.MAPPED, dtype=np.uint8))

    met = one.at(t_ns, 4)

    assert met[:2].tolist() == [[Met.MAPPED] * 3 + [Met.INVALID]] * 2
    assert (met[2:] == Met.OTHER).all()


times = st.lists(st.integers(0, 6), max_size=12).map(sorted)


@given(times, times)
def test_scans_of_one_time_are_told_apart_by_their_order(known, asked):
    classes = np.arange(len(known), dtype=np.uint8)[:, None]
    found = BeamsMet(np.array(known, dtype=np.int64), classes).at(np.array(asked, np.int64), 1)

    for k, t_ns in enumerate(asked):
        rows = [i for i, other in enumerate(known) if other == t_ns]
        order = asked[:k].count(t_ns)
        expected = rows[order] if order < len(rows) else int(Met.OTHER)
        assert found[k, 0] == expected


@given(st.integers(0, 2**32 - 1))
def test_beams_with_a_neighbour_equal_their_plain_twin(seed):
    rng = np.random.default_rng(seed)
    ends = rng.uniform(0.0, 0.6, (3, 8, 2)).astype(np.float32)
    those = rng.random((3, 8)) < 0.6
    kind = np.full((3, 8), HIT, dtype=np.int8)
    beams = Beams(np.arange(3), ends, kind, np.zeros(2))

    expected = np.zeros_like(those)
    for s in range(3):
        for b in range(8):
            for other in (b - 1, b + 1):
                if 0 <= other < 8 and those[s, b] and those[s, other]:
                    expected[s, b] |= np.hypot(*(ends[s, b] - ends[s, other])) <= TOGETHER_M
    assert np.array_equal(has_neighbour(beams, those), expected)


#: One scan from (0.55, 0.15) along y, five beams side by side; evidence cells of 0.1 m.
LATTICE = Lattice((10, 10), 1, 10, 0.1, np.zeros(2), np.zeros(1, dtype=np.int32))
POSE = np.array([[0.55, 0.15, np.pi / 2.0]])
END = (5, 5)  # row and column in which the beams end


def passes_by(empty: list[tuple[int, int]], stood: list[tuple[int, int]] = ()) -> bool:
    """Whether what a beam met passed by: cells that were empty once, and that something held."""
    slots, count = np.full((10, 10), -1, dtype=np.int32), np.zeros((10, 10), dtype=np.uint16)
    for k, cell in enumerate(stood):
        slots[cell] = k
    for cell in empty:
        count[cell] = 2
    hold = np.ones((len(stood), 1), dtype=bool)
    new = Standing(slots, hold, hold, ~hold, np.ones(len(stood)), np.zeros(len(stood)))
    where = np.array([[END[0] * 10 + END[1]]], dtype=np.int32)
    nearer = np.full((1, 1), NEARER, dtype=np.int8)
    laid = BeamsOnMap(nearer, where, np.zeros((1, 1), dtype=bool), np.zeros((1, 1), np.float32))
    ends = np.array([[[0.4, 0.0]]], dtype=np.float32)
    beams = Beams(np.zeros(1, np.int64), ends, np.full((1, 1), HIT, np.int8), np.zeros(2))
    passed = Passes(np.zeros((0, 1), dtype=bool), slots, count)
    return bool(passing(LATTICE, beams, POSE, laid, new, passed)[0, 0])


def test_what_passed_by_left_its_place_empty():
    behind, beside = (7, 5), (6, 6)

    assert passes_by([END, behind])
    assert not passes_by([])  # nobody ever looked through there: it may stand still
    assert not passes_by([behind])
    assert not passes_by([END])  # the face of something, which other beams grazed
    assert not passes_by([END, behind], [beside])  # the edge of what stood then
    assert passes_by([END, behind], [(8, 5)])


def test_classes_in_the_order_of_what_is_known():
    """Of one scan: met, at a wall, moving twice, moving alone, new, gone, silent, invalid."""
    says = np.array([[MET, NEARER, NEARER, NEARER, BEYOND, NEARER, NEARER, BEYOND, SILENT, MET]])
    n = says.shape[1]
    laid = BeamsOnMap(says, says, says > 0, says)
    ends = np.stack([np.arange(n) * 0.1, np.zeros(n)], axis=-1)[None].astype(np.float32)
    ends[0, 6:] += 1.0
    kind = np.full((1, n), HIT, dtype=np.int8)
    kind[0, -1] = INVALID
    flags = np.zeros((4, 1, n), dtype=bool)
    at_wall, is_new, is_gone, may_pass = flags
    at_wall[0, [1, 6, 7]] = is_new[0, 6] = is_gone[0, 7] = may_pass[0, [2, 3, 5]] = True

    met = what_was_met(
        Beams(np.zeros(1, np.int64), ends, kind, np.zeros(2)),
        laid,
        at_wall,
        (is_new, is_gone),
        may_pass,
    )

    assert [Met(code).name for code in met[0]] == [
        "MAPPED", "MAPPED", "MOVING", "MOVING", "OTHER", "OTHER", "APPEARED", "REMOVED", "OTHER",
        "INVALID",
    ]  # fmt: skip


def test_wall_that_is_seen_over_unmapped_ground_is_mapped():
    cells = room_grid().cells.copy()
    cells[3:177, 3:237][cells[3:177, 3:237] == 0] = -1  # nothing but a seam along the walls
    grid = OccupancyGrid(cells, 0.05, room_grid().origin_xyyaw)
    found = hindsight(rebuilt(synthetic_bundle(seconds=4.0), {}, grid).view())
    (one,) = found.changes.met

    assert found.coverage == 1.0
    assert not found.changes.changed_share.any()
    assert np.mean(one.met[one.met != Met.INVALID] == Met.MAPPED) > 0.98


def test_each_floor_has_its_beams_classed_in_its_own_map():
    first = synthetic_bundle(seconds=24.0, world=room_with_a_box())
    other = OccupancyGrid(np.flipud(room_grid().cells), 0.05, room_grid().origin_xyyaw)
    second = synthetic_bundle(seconds=24.0, world=other)
    switch_ns = START_NS + 12_000_000_000
    scans = [first.table("scans"), second.table("scans")]
    scans = [scans[0].take(scans[0].t_ns < switch_ns), scans[1].take(scans[1].t_ns >= switch_ns)]
    bundle = rebuilt(first, {"scans": Table.concat(TABLES["scans"], scans)})
    bundle = with_maps(bundle, [(START_NS, room_grid()), (switch_ns, other)])

    post = postmortem(bundle, cause=False)
    (shown,), changes = post.scene.scans, post.hindsight.changes

    assert len(post.hindsight.parts) == 2
    assert_shares(shown, changes)
    before = shown.t_ns < switch_ns
    hits = shown.met[shown.is_hit & ~before[:, None]]
    assert np.count_nonzero(shown.met[before] == Met.APPEARED) > 100
    assert np.mean(hits == Met.MAPPED) > 0.98


def test_repeated_stamps_do_not_mix_up_the_beams():
    post = postmortem(with_repeated_stamps(synthetic_bundle(seconds=6.0)), cause=False)

    assert_shares(post.scene.scans[0], post.hindsight.changes)


# --- logs that lack something, and logs that hold more ------------------------------------------


def test_scans_are_shown_without_a_map_too():
    post = postmortem(synthetic_bundle(seconds=3.0, with_map=False), cause=False)
    (scans,) = post.scene.scans

    assert post.hindsight is None
    assert scans.is_hit.mean() > 0.9
    assert (scans.met[scans.is_hit] == Met.OTHER).all()
    assert {lane.key for lane in post.scene.lanes} <= {"sigma_m", "nees"}


def test_log_without_scans_has_a_scene_without_any():
    bundle = without(synthetic_bundle(seconds=3.0), "scans")
    scene = postmortem(bundle, cause=False).scene

    assert scene.scans == ()
    assert scene.clouds is None
    assert scene.plans is None
    assert len(scene.footprint_xy) > 3


def test_lane_of_a_placeholder_covariance_is_left_out():
    bundle = synthetic_bundle(seconds=3.0)
    poses = bundle.table("poses")
    zero = poses.replace(covariance=np.zeros_like(poses["covariance"]))
    post = postmortem(rebuilt(bundle, {"poses": zero}), cause=False)

    lanes = [lane.key for lane in post.scene.lanes]

    assert "sigma_m" not in lanes
    assert "nees" not in lanes
    assert "error_m" in lanes


def test_largest_sigma_is_that_of_the_worst_direction():
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    cov = np.full((2, 3, 3), np.nan)
    cov[0] = np.diag([1.0, 1.0, 0.1])
    cov[0, :2, :2] = turn @ np.diag([0.04, 0.25]) @ turn.T

    sigma = largest_sigma(cov)

    assert sigma[0] == pytest.approx(0.5)
    assert np.isnan(sigma[1])


def rows_of(name: str, topic: str, t_s: list[float], /, **columns) -> Table:
    t_ns = ns_of(np.array(t_s))
    times = dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), t_ns)
    return Table(TABLES[name], {**times, "topic": [topic] * len(t_s), **columns})


def with_paths(bundle: Bundle) -> Bundle:
    """The bundle with two clouds and three plans; the last ones lie in the odometry's frame."""
    rng = np.random.default_rng(3)
    clouds = [np.column_stack([rng.normal(0, 1, (k, 2)), np.zeros(k)]) for k in (200, 1000)]
    weights = [np.ones(200), np.where(clouds[1][:, 0] > 0.0, 1.0, 0.0)]
    line = np.column_stack([np.arange(400) * 0.05, np.zeros(400), np.zeros(400)])
    particles = rows_of(
        "particles",
        "/cloud",
        [1.0, 2.0],
        frame_id=["map", "map"],
        xyyaw=Ragged.of(clouds, np.float64),
        weights=Ragged.of(weights, np.float64),
    )
    plans = rows_of(
        "plans",
        "/plan",
        [0.5, 1.5, 2.5],
        frame_id=["map", "odom", "elsewhere"],
        xyyaw=Ragged.of([line] * 3, np.float64),
    )
    made = rebuilt(bundle, {"particles": particles, "plans": plans})
    roles = [
        Role(role=role, topic=topic, type="t", messages=1, reason="r")
        for role, topic in (("particles", "/cloud"), ("plan", "/plan"))
    ]
    manifest = made.manifest.model_copy(update={"roles": [*made.manifest.roles, *roles]})
    tables = {name: made.table(name) for name in TABLES}
    return Bundle(manifest, tables, made.grids())


def test_particles_and_plans_lie_in_the_map_frame():
    bundle = with_paths(synthetic_bundle(seconds=3.0))
    post = postmortem(bundle, cause=False, scene=False)
    few, whole = (scene_of(post, bundle.view(), most_scans=most) for most in (30, None))

    assert np.diff(whole.clouds.first).tolist() == [200, 1000]
    assert np.diff(few.clouds.first).tolist() == [200, 300]
    assert (few.clouds.xyyaw[200:, 0] > 0.0).all()  # the others weigh nothing
    assert len(whole.plans.t_ns) == 2  # nothing ties the third one's frame to the map
    assert np.diff(whole.plans.first).tolist() == [400, 400]
    odom, valid = bundle.view().transforms.lookup("map", "odom", whole.plans.t_ns[1:])
    assert valid.all()
    np.testing.assert_allclose(whole.plans.xy[400], odom[0, :2, 3], atol=1e-5)
    np.testing.assert_allclose(few.plans.xy[[99, -1]], whole.plans.xy[[399, -1]])


def test_constant_offset_of_the_localizers_map_is_taken_out_of_particles_and_plans():
    bundle = with_paths(synthetic_bundle(seconds=3.0))
    post = postmortem(bundle, cause=False, scene=False)
    offset = (1.0, -2.0, 0.3)
    shifted = replace(post, frame_offset=ConstantOffset(offset, 2.2, 0.3, 0.01, "map"))
    own, there = (scene_of(p, bundle.view(), most_scans=None) for p in (post, shifted))

    np.testing.assert_allclose(se2.compose(offset, there.clouds.xyyaw), own.clouds.xyyaw, atol=1e-5)
    np.testing.assert_allclose(
        se2.transform_points(offset, there.plans.xy), own.plans.xy, atol=1e-5
    )


def test_more_moments_than_scans_still_are_looked_at():
    t_ns = np.arange(0, 10**12, 10**9)
    rows = chosen(t_ns, np.arange(5 * 10**11, 6 * 10**11, 10**9).tolist(), 40)

    assert len(rows) <= 40
    assert np.count_nonzero((rows >= 500) & (rows < 600)) >= 20


@given(
    st.lists(st.integers(0, 10**6), min_size=1, max_size=60).map(sorted),
    st.lists(st.integers(-100, 10**6 + 100), max_size=8),
    st.integers(2, 40),
)
@example([0, 1, 2, 3, 4], [2], 2)
def test_chosen_rows_hold_the_first_and_the_last_and_are_within_bounds(t_ns, moments, most):
    t_ns = np.array(t_ns, dtype=np.int64)
    rows = chosen(t_ns, moments, most)

    assert len(rows) <= most
    assert (np.diff(rows) > 0).all()
    assert (t_ns[rows[0]], t_ns[rows[-1]]) == (t_ns[0], t_ns[-1])
