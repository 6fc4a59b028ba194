"""Matching against plain-numpy twins and against poses that are known."""

import numba
import numpy as np
import pytest

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.correlative import Window, climb, match, match_each, search_window
from slamreplay.matching.field import ScoreField, points_field, working_map
from slamreplay.matching.kernels import _derivatives, match_jobs
from slamreplay.matching.thinning import thin, thin_persistent
from slamreplay.matching.whole_map import _score_lattice, search_map, search_space
from slamreplay.testing.synthetic import room_grid

RNG = np.random.Generator(np.random.PCG64(3))
SIGMA_M = 0.12


def scan_at(xyyaw: np.ndarray) -> np.ndarray:
    """Points of a scan in the room, base frame, from a pose in the grid's own frame."""
    grid = OccupancyGrid(room_grid().cells, 0.05, np.zeros(3))
    bearings = np.arange(-3.1, 3.1, 0.03)
    reach = cast_rays(grid, xyyaw, bearings, 20.0)[0]
    return np.column_stack([reach * np.cos(bearings), reach * np.sin(bearings)])


def plain_score(field: ScoreField, points: np.ndarray, pose: np.ndarray) -> float:
    cell = (se2.transform_points(pose, points) - field.corner_xy) / field.resolution_m
    col, row = np.floor(cell).astype(int).T
    height, width = field.values.shape
    inside = (row >= 0) & (row < height) & (col >= 0) & (col < width)
    return float(field.values[row[inside], col[inside]].sum() / len(points))


def plain_total(field: ScoreField, points: np.ndarray, pose: np.ndarray) -> float:
    """Summed score between cell centres."""
    u = (se2.transform_points(pose, points) - field.corner_xy) / field.resolution_m - 0.5
    height, width = field.values.shape
    u = u[(u >= 0.0).all(axis=1) & (u[:, 0] < width - 1) & (u[:, 1] < height - 1)]
    cell = u.astype(int)
    total = 0.0
    for dx in (0, 1):
        for dy in (0, 1):
            weight = np.abs(1 - np.array([dx, dy]) - (u - cell)).prod(axis=1)
            total += (weight * field.values[cell[:, 1] + dy, cell[:, 0] + dx]).sum()
    return total


def plain_thin(points: np.ndarray, spacing_m: float) -> np.ndarray:
    cells = np.floor(points / spacing_m)
    order = np.unique(cells[:, ::-1], axis=0)[:, ::-1]
    return np.array([points[(cells == cell).all(axis=1)].mean(axis=0) for cell in order])


def test_thinning_equals_its_plain_twin():
    points = RNG.uniform(-2.0, 3.0, (400, 2))

    np.testing.assert_allclose(thin(points, 0.25), plain_thin(points, 0.25), rtol=0, atol=1e-14)
    assert thin(np.empty((0, 2)), 0.1).shape == (0, 2)


def test_thinning_gives_each_lattice_cell_its_mean():
    points = np.array([[0.01, 0.01], [0.03, 0.05], [0.25, 0.01]])

    np.testing.assert_allclose(thin(points, 0.1), [[0.02, 0.03], [0.25, 0.01]])


def test_what_one_view_saw_is_left_out():
    wall = np.column_stack([np.arange(0.05, 4.0, 0.1), np.zeros(40)])
    person = np.array([[1.0, 2.0]])
    views = np.repeat([0, 1, 1], [40, 40, 1])

    kept = thin_persistent(np.concatenate([wall, wall, person]), views, 0.1, 30)

    assert len(kept) == 30
    assert (kept[:, 1] < 0.1).all()


def test_points_field_is_the_largest_bell_over_each_cell():
    points = RNG.uniform(0.0, 1.0, (5, 2))
    field = points_field(points, 0.08)
    rows, cols = np.indices(field.values.shape)
    centres = field.corner_xy + (np.stack([cols, rows], axis=-1) + 0.5) * field.resolution_m
    d2 = ((centres[:, :, None] - points) ** 2).sum(axis=-1).min(axis=-1)

    expected = np.exp(-0.5 * d2 / 0.08**2)

    near = expected > np.exp(-0.5 * 2.5**2)
    np.testing.assert_allclose(field.values[near], expected[near], atol=1e-6)


def test_a_field_in_room_that_was_used_before_is_the_same():
    points, room = RNG.uniform(0.0, 1.0, (5, 2)), np.ones(5000, dtype=np.float32)

    inside, fresh = points_field(points, 0.08, room=room), points_field(points, 0.08)

    assert np.shares_memory(inside.values, room)
    np.testing.assert_array_equal(inside.values, fresh.values)
    assert points_field(points, 0.08, room=room[:9]).values.shape == fresh.values.shape


def test_working_map_is_cropped_and_thinned_and_keeps_its_place():
    cells = np.full((600, 700), -1, dtype=np.int8)
    cells[203:301, 102:401] = 0
    cells[250, 300] = 100
    grid = OccupancyGrid(cells, 0.01, np.array([1.0, 2.0, 0.4]))

    working = working_map(grid)

    assert working is not None
    assert working.resolution_m == pytest.approx(0.05)
    assert working.walls.sum() == 1
    row, col = np.argwhere(working.walls)[0]
    at = working.corner_xy + (np.array([col, row]) + 0.5) * working.resolution_m
    in_map = working.to_map(np.array([*at, 0.0]))[:2]
    assert np.abs(in_map - grid.centre_of(np.array([250, 300]))).max() < 0.05


def test_map_without_known_cells_or_walls_gives_nothing():
    assert working_map(OccupancyGrid(np.full((9, 9), -1, np.int8), 0.05, np.zeros(3))) is None
    assert working_map(OccupancyGrid(np.zeros((9, 9), np.int8), 0.05, np.zeros(3))) is None


def test_window_search_finds_the_best_pose_of_its_lattice():
    points = RNG.uniform(-1.0, 1.0, (40, 2))
    field = points_field(points, 0.1)
    window = Window(0.2, 0.1, 0.2, 0.1)
    centre = np.array([0.13, -0.08, 0.1])
    poses = [
        centre + np.array([i * 0.1, j * 0.1, k * 0.1])
        for i in range(-2, 3)
        for j in range(-2, 3)
        for k in range(-2, 3)
    ]

    pose, score = search_window(field, points, centre, window)

    best = max(plain_score(field, points, p) for p in poses)
    assert score == pytest.approx(best, abs=1e-6)
    assert plain_score(field, points, pose) == pytest.approx(best, abs=1e-6)


def test_derivatives_are_central_differences_of_the_plain_sum():
    # Some of the points lie on the field's edge and outside it.
    field = points_field(RNG.uniform(-1.0, 1.0, (60, 2)), 0.1)
    points = RNG.uniform(-1.4, 1.4, (300, 2))
    pose, steps = np.array([0.02, 0.03, 0.1]), np.diag([field.resolution_m] * 2 + [0.01])
    gradient, information = np.zeros(3), np.zeros((3, 3))
    frame = (field.values, field.resolution_m, *field.corner_xy)

    _derivatives(*frame, points, pose, np.zeros((3, 3, 3)), gradient, information)

    def total(*moves: np.ndarray) -> float:
        return plain_total(field, points, pose + np.sum(moves, axis=0))

    for i, a in enumerate(steps):
        assert gradient[i] == pytest.approx((total(a) - total(-a)) / (2 * a[i]), abs=1e-6)
        bend = total(a) - 2 * total(np.zeros(3)) + total(-a)
        assert information[i, i] == pytest.approx(-bend / a[i] ** 2, abs=1e-5)
        for j, b in enumerate(steps[:i]):
            twist = total(a, b) - total(a, -b) - total(-a, b) + total(-a, -b)
            assert information[i, j] == pytest.approx(-twist / (4 * a[i] * b[j]), abs=1e-5)
            assert information[i, j] == information[j, i]


def test_matching_many_equals_matching_each_on_any_number_of_threads(monkeypatch):
    field = points_field(RNG.uniform(-2.0, 2.0, (200, 2)), 0.1)
    clouds = [RNG.uniform(-2.0, 2.0, (n, 2)) for n in RNG.integers(0, 60, 70)]
    centres = RNG.normal(0.0, 0.1, (70, 3))
    windows = [Window(0.2, 0.1, 0.1, 0.05, 0.1), Window(0.1, 0.1, 0.0, 0.1)] * 35
    found = []

    for threads in (1, 2, 3):
        monkeypatch.setattr(numba, "get_num_threads", lambda threads=threads: threads)
        found.append(match_each(field, clouds, centres, windows))

    for one in found[1:]:
        assert one.xyyaw.tobytes() == found[0].xyyaw.tobytes()
        assert one.information.tobytes() == found[0].information.tobytes()
    for k, (cloud, centre, window) in enumerate(zip(clouds, centres, windows, strict=True)):
        single = match(field, cloud, centre, window)
        assert single.xyyaw.tobytes() == found[0].xyyaw[k].tobytes()
        assert single.score == found[0].score[k]


def test_one_cloud_is_matched_at_many_places():
    field = points_field(RNG.uniform(-2.0, 2.0, (200, 2)), 0.1)
    cloud, centres = RNG.uniform(-2.0, 2.0, (50, 2)), RNG.normal(0.0, 0.1, (20, 3))

    found = match_each(field, [cloud], centres, None)

    assert [m.xyyaw.tolist() for m in (climb(field, cloud, c) for c in centres)] == (
        found.xyyaw.tolist()
    )
    assert match_each(field, [cloud], np.empty((0, 3)), None).score.shape == (0,)


def test_one_compiled_kernel_serves_arrays_of_any_kind():
    field = points_field(RNG.uniform(-2.0, 2.0, (200, 2)), 0.1)
    cloud, centres = RNG.uniform(-2.0, 2.0, (50, 2)), RNG.normal(0.0, 0.1, (20, 3))
    match_each(field, [cloud], centres, None)
    compiled = len(match_jobs.signatures)

    match_each(field, [cloud] * 20, np.asfortranarray(centres), Window(0.1, 0.1, 0.1, 0.1))
    match_each(field, [cloud], centres[:1], None)
    frozen = centres[1].copy()
    frozen.setflags(write=False)
    climb(field, cloud, frozen)

    assert len(match_jobs.signatures) == compiled


def test_climb_reaches_the_true_pose():
    grid = room_grid()
    field = working_map(grid).field(SIGMA_M)
    truth = np.array([3.7, 6.1, 0.7])
    found = climb(field, thin(scan_at(truth), 0.1), truth + np.array([0.06, -0.05, 0.02]))

    assert np.abs(found.xyyaw - truth)[:2].max() < 0.03
    assert abs(found.xyyaw[2] - truth[2]) < 0.005
    assert found.score > 0.9
    assert np.linalg.eigvalsh(found.information).min() > 0.0


def test_a_single_wall_holds_no_position_along_it():
    wall = np.column_stack([np.linspace(-3.0, 3.0, 100), np.full(100, 1.0)])
    long = np.column_stack([np.linspace(-9.0, 9.0, 300), np.full(300, 1.0)])
    found = climb(points_field(long, 0.1), wall, np.array([0.0, 0.03, 0.0]))

    assert abs(found.xyyaw[1]) < 0.01
    assert abs(found.xyyaw[0]) < 0.02
    assert found.information[1, 1] > 1000.0
    assert abs(found.information[0, 0]) < 0.01 * found.information[1, 1]


def test_matching_no_points_stays_where_it_is():
    field = working_map(room_grid()).field(SIGMA_M)
    found = match(field, np.empty((0, 2)), np.array([1.0, 1.0, 0.0]), Window(0.1, 0.1, 0.1, 0.1))

    assert found.score == 0.0
    assert found.xyyaw[:2] == pytest.approx([1.0, 1.0], abs=0.2)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_lattice_scores_equal_their_plain_sum(monkeypatch, threads):
    monkeypatch.setattr(numba, "get_num_threads", lambda threads=threads: threads)
    coarse = RNG.integers(0, 251, (9, 11)).astype(np.uint8)
    cells = RNG.uniform(-3.0, 3.0, (10, 2))
    headings = np.arange(16) * (np.pi / 8.0)
    reach = 6
    best, which = _score_lattice(np.pad(coarse, reach), reach, cells, headings, 2)

    padded = np.pad(coarse, reach).astype(int)
    for sector in range(8):
        scores = []
        for heading in headings[2 * sector : 2 * sector + 2]:
            turned = se2.transform_points(np.array([0.5, 0.5, heading]), cells)
            col, row = np.floor(turned).astype(int).T + reach
            rows, cols = np.indices(coarse.shape)
            scores.append(padded[rows[..., None] + row, cols[..., None] + col].sum(axis=-1))
        np.testing.assert_array_equal(best[sector], np.max(scores, axis=0))
        np.testing.assert_array_equal(which[sector], np.argmax(scores, axis=0))


@pytest.mark.parametrize("truth", [(2.0, 2.0, 0.3), (9.5, 6.5, -2.4), (6.0, 7.4, 1.9)])
def test_whole_map_search_finds_a_scan_anywhere(truth):
    working = working_map(room_grid())
    space = search_space(working, working.field(SIGMA_M))
    poses, scores = search_map(space, thin(scan_at(np.array(truth)), 0.2))

    assert np.abs(se2.between(np.array(truth), poses[0])).max() < 0.05
    assert scores[0] > scores[1] + 0.03
    assert (np.diff(scores) <= 1e-12).all()
