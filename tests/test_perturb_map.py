"""Maps that are moved, old or edited: by what the level says, at a place that is seen."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.estimators import ESTIMATORS
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.maps.edits import with_walls, with_walls_moved, without_walls
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.perturb import PERTURBATIONS
from slamreplay.testing.edits import rebuilt, with_maps, without
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle, true_path

BUNDLE = synthetic_bundle(seconds=24.0)
ROOM = room_grid()
EDITS = ("appeared", "removed", "moved")


def perturbed(text: str, level: float, view=None, seed: int = 0):
    name, _, variant = text.partition(".")
    rng = np.random.Generator(np.random.PCG64(seed))
    return PERTURBATIONS.load(name)().apply(view or BUNDLE.view(), variant, level, rng)


def redrawn(k: int) -> OccupancyGrid:
    """The room with k small posts in it: its k-th version."""
    cells = ROOM.cells.copy()
    for post in range(k):
        cells[60:63, 20 + 8 * post : 23 + 8 * post] = 100
    return OccupancyGrid(cells, ROOM.resolution_m, ROOM.origin_xyyaw)


def other_place() -> OccupancyGrid:
    return OccupancyGrid(ROOM.cells[::-1].copy(), ROOM.resolution_m, ROOM.origin_xyyaw)


#: The room drawn three times, 8 s each.
THREE = with_maps(BUNDLE, [(START_NS + 8 * k * NS_PER_S, redrawn(k)) for k in range(3)])


#: The room drawn twice, each for longer than the shortest stretch.
TWO = with_maps(BUNDLE, [(START_NS + 12 * k * NS_PER_S, redrawn(k)) for k in range(2)])


@pytest.mark.parametrize("bundle", [BUNDLE, TWO, THREE])
@pytest.mark.parametrize(
    ("text", "level", "T"),
    [("map_shift.x", 0.7, [0.7, 0.0, 0.0]), ("map_shift.y", -2.0, [0.0, -2.0, 0.0])],
)
def test_every_version_moves_as_a_whole(bundle, text, level, T):
    before = bundle.view()

    after = perturbed(text, level, before)

    assert [(h.start_ns, h.end_ns) for h in after.map_course] == [
        (h.start_ns, h.end_ns) for h in before.map_course
    ]
    assert len(after.map_stretches) == len(before.map_stretches) == 1
    for old, new in zip(before.map_course, after.map_course, strict=True):
        grid, moved = before.grid_of(old.version), after.grid_of(new.version)
        np.testing.assert_array_equal(moved.cells, grid.cells)
        np.testing.assert_allclose(moved.centre_of([7, 9]), grid.centre_of([7, 9]) + T[:2])
    assert after.grid.version == after.map_course[-1].version != before.grid.version


def test_a_turned_map_turns_about_the_middle_of_what_it_knows():
    cells = np.full((300, 300), -1, dtype=np.int8)
    cells[20:200, 30:270] = ROOM.cells
    wide = OccupancyGrid(cells, 0.05, ROOM.origin_xyyaw)
    view = BUNDLE.view().with_grid(wide)

    turned = perturbed("map_rotate.centre", 90.0, view).grid

    middle = [109.5, 149.5]
    np.testing.assert_allclose(turned.centre_of(middle), wide.centre_of(middle), atol=1e-9)
    off = wide.centre_of([20, 30]) - wide.centre_of(middle)
    there = turned.centre_of([20, 30]) - turned.centre_of(middle)
    np.testing.assert_allclose(there, [-off[1], off[0]], atol=1e-9)


def test_amcl_goes_by_the_map_it_is_given():
    scans = BUNDLE.table("scans").t_ns[20:]
    truth = true_path((scans - START_NS) / NS_PER_S)

    track = ESTIMATORS.load("amcl")().run(perturbed("map_shift.x", 0.4), seed=0).track.at(scans)

    apart = (track.xyyaw - truth)[:, :2][track.has_pose]
    np.testing.assert_allclose(np.median(apart, axis=0), [0.4, 0.0], atol=0.1)


@pytest.mark.parametrize("back", [1, 2])
def test_a_stale_map_is_so_many_versions_older(back):
    view = perturbed("map_stale.versions", back, THREE.view())

    assert view.grid.version == redrawn(2 - back).version
    names = [h.version for h in view.map_course]
    assert names == [redrawn(k).version for k in ((0, 1) if back == 1 else (0,))]
    assert view.map_course[0].start_ns == THREE.view().map_course[0].start_ns
    assert view.map_course[-1].end_ns == THREE.view().map_course[-1].end_ns


def test_an_old_enough_map_is_the_one_of_before():
    assert perturbed("map_stale.age", 4.0, THREE.view()).grid.version == redrawn(2).version
    assert perturbed("map_stale.age", 9.0, THREE.view()).grid.version == redrawn(1).version
    assert perturbed("map_stale.age", 1e5, THREE.view()).grid.version == redrawn(0).version
    begins = [h.start_ns for h in perturbed("map_stale.age", 4.0, THREE.view()).map_course]
    assert (np.array(begins[1:]) - START_NS).tolist() == [12 * NS_PER_S, 20 * NS_PER_S]


def test_there_must_be_an_older_version_of_the_same_place():
    with pytest.raises(NotApplicableError, match="3 versions, none is 3 older"):
        perturbed("map_stale.versions", 3.0, THREE.view())
    with pytest.raises(UsageError, match=r"1\.5 of 'map_stale.versions' is not a whole number"):
        perturbed("map_stale.versions", 1.5, THREE.view())
    for text in ("map_stale.versions", "map_stale.age"):
        with pytest.raises(NotApplicableError, match="one version"):
            perturbed(text, 1.0)
    moved = with_maps(BUNDLE, [(START_NS, other_place()), (START_NS + 12 * NS_PER_S, ROOM)])
    with pytest.raises(NotApplicableError, match="1 version, none is 1 older"):
        perturbed("map_stale.versions", 1.0, moved.view())


MAPPED = [f"map_edit.{v}" for v in EDITS] + ["map_shift.x", "map_rotate.centre", "map_stale.age"]


@pytest.mark.parametrize("text", MAPPED)
def test_a_log_without_a_map_is_told_in_one_line(text):
    with pytest.raises(NotApplicableError, match="no map"):
        perturbed(text, 1.0, without(BUNDLE, "map").view())


def changed(view, variant, level, seed=0):
    """(H, W) cells that an edit changes, and the edited map."""
    after = perturbed(f"map_edit.{variant}", level, view, seed).grid
    return after.cells != view.grid.cells, after


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(EDITS), st.floats(0.01, 4.0), st.floats(0.01, 4.0), st.integers(0, 50))
def test_a_greater_edit_with_the_same_seed_holds_the_smaller_one(variant, a, b, seed):
    view = BUNDLE.view()

    small, before = changed(view, variant, min(a, b), seed)
    great, after = changed(view, variant, max(a, b), seed)

    assert small.any()
    if variant == "moved":  # where a wall is taken off another one may be drawn
        small, great = small & before.occupied, great & after.occupied
        small, great = small & ~ROOM.occupied, great & ~ROOM.occupied
    assert (great | ~small).all()
    at = after.centre_of(np.argwhere(great))
    reach = max(a, b) + (0.5 if variant == "appeared" else 0.7 if variant == "moved" else 0.0)
    assert np.hypot(*np.ptp(at, axis=0)) <= np.sqrt(2.0) * (reach + 0.11)


def contradicted(grid):
    """(N,) share of each scan's returns that lie otherwise than a map says, from the true poses."""
    scans = scan_set(BUNDLE.view())
    true = se2.compose(true_path((scans.t_ns - START_NS) / NS_PER_S), scans.xyyaw_base_laser)
    said = cast_rays(grid, true, scans.bearings(0), 12.0)
    seen = np.where(scans.hits, scans.ranges_m, np.nan)
    return np.mean(np.abs(said - seen) > 0.25, axis=1)


@pytest.mark.parametrize("variant", EDITS)
@pytest.mark.parametrize("seed", range(4))
def test_scans_contradict_the_edited_map_where_the_robot_passes(variant, seed):
    before = contradicted(ROOM)

    small, great = (contradicted(changed(BUNDLE.view(), variant, m, seed)[1]) for m in (0.6, 2.0))

    assert (before < 0.03).all()
    assert np.mean(small > before) > 0.25
    assert great.mean() > small.mean() > before.mean()
    places = {
        changed(BUNDLE.view(), variant, 1.0, k)[1].version for k in (seed, seed + 1, seed + 2)
    }
    assert len(places) == 3


def test_what_appeared_is_free_what_was_removed_is_a_wall_and_what_moved_is_both():
    view = BUNDLE.view()
    gone, after = changed(view, "appeared", 1.0)
    assert ROOM.occupied[gone].all()
    assert after.free[gone].all()

    drawn, after = changed(view, "removed", 1.0)
    assert ROOM.free[drawn].all()
    assert after.occupied[drawn].all()
    assert np.count_nonzero(drawn) * 0.05**2 == pytest.approx(np.pi / 4, rel=0.05)

    _, after = changed(view, "moved", 1.0)
    assert (after.occupied & ~ROOM.occupied).any()
    assert (after.free & ROOM.occupied).any()


def test_the_place_is_found_from_the_initial_pose_where_nobody_believed_anything():
    silent = synthetic_bundle(seconds=24.0, with_belief=False).view()
    for variant in EDITS:
        cells, _ = changed(silent, variant, 1.0)
        assert cells.any()
    lost = synthetic_bundle(seconds=24.0, with_belief=False, with_initial_pose=False).view()
    with pytest.raises(NotApplicableError, match="nothing says where"):
        perturbed("map_edit.appeared", 1.0, lost)


def test_every_version_is_edited_at_one_place():
    after = perturbed("map_edit.removed", 1.0, THREE.view())

    assert len(after.map_course) == 3
    for k, held in enumerate(after.map_course):
        old, new = redrawn(k), after.grid_of(held.version)
        assert np.count_nonzero(old.cells != new.cells) > 100
    last, first = (after.grid_of(after.map_course[k].version).cells for k in (2, 0))
    np.testing.assert_array_equal(last != redrawn(2).cells, first != redrawn(0).cells)


def test_a_map_of_nothing_that_is_seen_cannot_be_edited():
    blank = OccupancyGrid(np.zeros((20, 20), np.int8), 0.05, np.array([90.0, 90.0, 0.0]))
    view = BUNDLE.view().with_grid(blank)

    for variant, what in (("appeared", "wall"), ("moved", "wall"), ("removed", "free place")):
        with pytest.raises(NotApplicableError, match=f"see no {what} of the map"):
            perturbed(f"map_edit.{variant}", 1.0, view)
    empty = rebuilt(BUNDLE, {"scans": Table.empty(TABLES["scans"])}).view()
    with pytest.raises(NotApplicableError, match="no scans"):
        perturbed("map_edit.removed", 1.0, empty)


def test_a_stretch_of_a_log_takes_another_map_as_well():
    places = with_maps(BUNDLE, [(START_NS, other_place()), (START_NS + 12 * NS_PER_S, ROOM)])
    view = places.view()
    second = view.within(view.map_stretches[1])

    shifted = perturbed("map_shift.x", 0.5, second)
    again = perturbed("map_shift.x", 0.5, shifted)

    for k, after in enumerate((shifted, again)):
        assert after.map_course[0].version == after.map_stretches[0].version == after.grid.version
        assert after.grid.origin_xyyaw[0] == pytest.approx(ROOM.origin_xyyaw[0] + 0.5 * (k + 1))
        assert after.span == second.span
    assert second.with_grid(redrawn(1)).grid.version == redrawn(1).version
    parts = perturbed("map_shift.x", 0.5, view).map_stretches
    assert [(p.start_ns, p.end_ns) for p in parts] == [
        (p.start_ns, p.end_ns) for p in view.map_stretches
    ]


def test_edits_of_cells():
    cells = np.full((40, 40), -1, dtype=np.int8)
    cells[5:30, 5:30] = 0
    cells[30, 5:30] = 100
    grid = OccupancyGrid(cells, 0.1, np.array([1.0, 2.0, 0.3]), "floor")
    wall = np.array([[30, c] for c in range(10, 15)])

    off = without_walls(grid, wall)
    assert (off.cells[30:36, 10:15] == 0).all()
    assert (off.cells[36:, 10:15] == -1).all()
    assert np.count_nonzero(off.occupied) == 20
    assert off.frame_id == "floor"
    np.testing.assert_array_equal(without_walls(grid, wall[:0]).cells, grid.cells)
    assert with_walls(grid, np.array([[10, 10]])).cells[10, 10] == 100
    shift = se2.transform_points([0.0, 0.0, 0.3], np.array([[0.0, -0.5]]))[0]
    there, drawn = with_walls_moved(grid, wall, shift)
    np.testing.assert_array_equal(drawn, wall - [5, 0])
    assert (there.cells[25, 10:15] == 100).all()
    assert not len(with_walls_moved(grid, wall, [100.0, 0.0])[1])


def test_a_belief_of_another_map_is_not_asked_where_the_robot_was():
    elsewhere = synthetic_bundle(seconds=24.0, belief_offset_xyyaw=(0.0, 60.0, 1.0)).view()

    cells, _ = changed(elsewhere, "appeared", 1.0)

    assert cells.any()
