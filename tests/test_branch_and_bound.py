"""Branch and bound against scoring every pose, and the bounds against plain maxima."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching import branch_and_bound
from slamreplay.matching.branch_and_bound import PoseWindow, best_pose, heading_step
from slamreplay.matching.field import ScoreField, working_map
from slamreplay.matching.pyramid import BYTE, LEVELS, SPREADS, pyramid
from slamreplay.matching.thinning import thin
from slamreplay.testing.synthetic import room_grid

ROOM = working_map(room_grid())
FIELD = ROOM.field(0.07)
BOUNDS = pyramid(FIELD)


def scan_at(pose, step=0.02, spacing=0.2):
    """Points of a scan in the room, base frame, from a pose in the grid's own frame."""
    grid = OccupancyGrid(room_grid().cells, 0.05, np.zeros(3))
    bearings = np.arange(-3.1, 3.1, step)
    reach = cast_rays(grid, pose, bearings, 20.0)[0]
    return thin(np.column_stack([reach * np.cos(bearings), reach * np.sin(bearings)]), spacing)


def every_pose(field, points, window, step, *, whole_turn=False):
    """Scores (K, rows, columns) of all poses of a window, one shift of the field after another."""
    sides = np.ceil(np.array(window.reach_m) / field.resolution_m - 1e-9).astype(int)
    turns = int(np.ceil(window.reach_rad / step - 1e-9))
    headings = window.centre[2] + step * np.arange(-turns, turns + 1)
    if whole_turn:
        count = int(np.ceil(2.0 * np.pi / step))
        headings = window.centre[2] + 2.0 * np.pi / count * np.arange(count)
    corner = window.centre[:2] - sides * field.resolution_m - field.corner_xy
    scores = np.zeros((len(headings), 2 * sides[1] + 1, 2 * sides[0] + 1))
    height, width = scores.shape[1:]
    for k, heading in enumerate(headings):
        turned = se2.transform_points(np.array([*corner, heading]), points) / field.resolution_m
        cells = np.floor(turned).astype(int)
        # A margin of nothing on all sides, as wide as points or poses may lie outside.
        low, high = -cells.min(axis=0).clip(max=0), cells.max(axis=0).clip(min=0)
        margin = ((low[1], high[1] + height), (low[0], high[0] + width))
        whole = np.pad(field.values.astype(np.float64), margin)
        for col, row in cells + low:
            scores[k] += whole[row : row + height, col : col + width]
    return scores / len(points)


def check(field, bounds, points, window, step=None):
    found = best_pose(bounds, points, window, step_rad=step)
    step = heading_step(points, field.resolution_m) if step is None else step
    scores = every_pose(field, points, window, step, whole_turn=window.reach_rad >= np.pi)
    assert found is not None
    assert found.score == pytest.approx(scores.max(), abs=1e-12)
    # The pose is one of those that score so.
    at = np.rint((found.xyyaw[:2] - window.centre[:2]) / field.resolution_m).astype(int)
    middle = np.array(scores.shape[1:]) // 2
    heading = scores[:, middle[0] + at[1], middle[1] + at[0]]
    assert heading.max() == pytest.approx(scores.max(), abs=1e-12)
    return found


@pytest.mark.parametrize("truth", [(2.0, 2.0, 0.3), (9.5, 6.5, -2.4), (6.0, 7.4, 1.9)])
def test_the_optimum_of_a_window_is_found(truth):
    points = scan_at(np.array(truth))
    guess = np.array(truth) + np.array([0.21, -0.17, 0.1])

    found = check(FIELD, BOUNDS, points, PoseWindow(guess, (0.5, 0.4), 0.3))

    assert np.abs(se2.between(np.array(truth), found.xyyaw)).max() < 0.08


def test_the_optimum_of_the_whole_map_is_found():
    truth = np.array([9.5, 6.5, -2.4])
    points = scan_at(truth, spacing=0.5)

    found = check(FIELD, BOUNDS, points, PoseWindow.whole(FIELD), 0.05)

    assert np.abs(se2.between(truth, found.xyyaw)).max() < 0.1


@given(seed=st.integers(0, 10**6), coarse=st.booleans(), step=st.sampled_from([None, 0.02, 0.3]))
@settings(max_examples=25, deadline=None)
def test_the_optimum_is_found_in_noise_that_holds_no_pose(seed, coarse, step):
    rng = np.random.default_rng(seed)
    shape = rng.integers(5, 70, 2)
    values = rng.random(shape, dtype=np.float32) ** 4
    values[rng.random(shape) < rng.random()] = 0.0
    values[-1, -1] = 0.5
    field = ScoreField(values, 0.1, rng.normal(0.0, 5.0, 2))
    points = rng.normal(0.0, 1.5, (rng.integers(1, 30), 2))
    centre = np.append(field.corner_xy + np.array(shape[::-1]) * 0.05, rng.uniform(-3.0, 3.0))
    window = PoseWindow(centre, (rng.uniform(0, 3), rng.uniform(0, 3)), rng.uniform(0.0, 0.5))
    if best_pose(pyramid(field), points, window, step_rad=step) is None:
        assert every_pose(field, points, window, step or heading_step(points, 0.1)).max() == 0.0
    else:
        check(field, pyramid(field), points, window, step)


@pytest.mark.parametrize("step", [0.004, 0.02, 0.1])
@pytest.mark.parametrize("worth", [0, 10**9])
def test_bounds_of_nodes_are_no_less_than_any_of_their_poses(monkeypatch, step, worth):
    monkeypatch.setattr(branch_and_bound, "_WORTH_ADDING", worth)  # together or one by one
    rng = np.random.default_rng(4)
    values = np.where(rng.random((90, 120)) < 0.02, rng.random((90, 120)), 0.0)
    field = ScoreField(values.astype(np.float32), 0.05, np.zeros(2))
    bounds, points = pyramid(field), rng.normal(0.0, 1.5, (40, 2))
    window = PoseWindow(np.array([3.0, 2.2, 0.4]), (1.0, 0.8), 20 * step)
    lattice = branch_and_bound._lattice(field, points, window, step)
    search = branch_and_bound._search(bounds, lattice)
    scores = every_pose(field, points, window, step) * len(points)
    assert lattice.longest_run == {0.004: 8, 0.02: 4, 0.1: 2}[step]
    for level in range(1, 4):
        tops = branch_and_bound._bound_tops(bounds, search, level) / BYTE
        run, square = min(1 << level, lattice.longest_run), 1 << level
        for k, i, j in np.ndindex(scores.shape):
            assert tops[k // run, i // square, j // square] >= scores[k, i, j] - 1e-9
    # They are bounds, and not far ones: no more than a point's score per cell they span.
    assert tops.max() < 0.8 * len(points)


def test_more_points_than_a_sum_of_bytes_holds():
    truth = np.array([3.7, 6.1, 0.7])
    points = scan_at(truth, 0.004, 0.01)
    assert len(points) > 700

    # From the truth itself the points would lie on the edges of cells, where rounding decides.
    window = PoseWindow(truth + np.array([0.013, -0.011, 0.003]), (2.0, 2.0), 0.02)
    assert branch_and_bound._WORTH_ADDING <= 5 * 5 * 4
    check(FIELD, BOUNDS, points, window)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_change_nothing(monkeypatch, threads):
    points = scan_at(np.array([9.5, 6.5, -2.4]))
    once = best_pose(BOUNDS, points, PoseWindow.whole(FIELD))
    monkeypatch.setattr(numba, "get_num_threads", lambda: threads)

    again = best_pose(BOUNDS, points, PoseWindow.whole(FIELD))

    assert again.xyyaw.tobytes() == once.xyyaw.tobytes()
    assert (again.score, again.nodes) == (once.score, once.nodes)


def test_a_score_below_the_least_is_nothing():
    truth = np.array([3.7, 6.1, 0.7])
    window = PoseWindow(truth, (0.3, 0.3), 0.1)
    points = scan_at(truth)
    found = best_pose(BOUNDS, points, window)

    assert best_pose(BOUNDS, points, window, min_score=found.score + 1e-9) is None
    again = best_pose(BOUNDS, points, window, min_score=found.score - 1e-9)
    assert again.xyyaw.tobytes() == found.xyyaw.tobytes()
    assert again.nodes <= found.nodes
    assert best_pose(BOUNDS, np.empty((0, 2)), window) is None
    nowhere = PoseWindow(np.array([500.0, 500.0, 0.0]), (0.3, 0.3), 0.1)
    assert best_pose(BOUNDS, points, nowhere) is None


@pytest.mark.parametrize(("first_nodes", "few"), [(0, 0.0), (0, 1.0)])
def test_any_way_down_leads_to_the_optimum(monkeypatch, first_nodes, few):
    points = scan_at(np.array([9.5, 6.5, -2.4]), spacing=0.4)
    points[::2] *= 0.6
    once = best_pose(BOUNDS, points, PoseWindow.whole(FIELD))
    monkeypatch.setattr(branch_and_bound, "_FIRST_NODES", first_nodes)
    monkeypatch.setattr(branch_and_bound, "_FEW", few)

    again = best_pose(BOUNDS, points, PoseWindow.whole(FIELD))

    assert again.score == once.score
    assert again.nodes != once.nodes


def test_most_poses_are_never_scored():
    points = scan_at(np.array([9.5, 6.5, -2.4]))
    found = best_pose(BOUNDS, points, PoseWindow.whole(FIELD))

    headings = 2.0 * np.pi / heading_step(points, FIELD.resolution_m)
    assert found.nodes < 1e-3 * FIELD.values.size * headings


def test_tables_hold_the_largest_score_of_each_square():
    values = np.random.default_rng(2).random((13, 21), dtype=np.float32)
    made = pyramid(ScoreField(values, 0.1, np.zeros(2)))
    height, width = made.padded
    tables = made.bounds.reshape(LEVELS, len(SPREADS), height, width)
    whole = np.zeros((height + 64, width + 64))
    whole[made.margin : made.margin + 13, made.margin : made.margin + 21] = values
    for level in range(1, LEVELS + 1):
        square = 1 << level
        for k, spread in enumerate(SPREADS):
            planes = tables[level - 1, k].reshape(square, square, height // square, -1)
            table = planes.transpose(2, 0, 3, 1).reshape(height, width)
            edge = square + spread
            views = np.lib.stride_tricks.sliding_window_view(whole, (edge, edge))
            expected = np.ceil(views[:height, :width].max(axis=(2, 3)) * BYTE)
            np.testing.assert_array_equal(table, expected)
