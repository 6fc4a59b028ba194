"""Registration of points with points: poses that are known, directions that nothing holds."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.icp import IcpSettings, icp
from slamreplay.matching.icp_kernels import axes, nearest, sum_up
from slamreplay.matching.line_target import line_target
from slamreplay.matching.open3d_icp import icp_open3d
from slamreplay.testing.synthetic import room_grid

NOISE_M = 0.01
BEARINGS = np.arange(-2.3, 2.3, 0.01)


def scan_at(pose, rng, noise_m=NOISE_M):
    grid = OccupancyGrid(room_grid().cells, 0.05, np.zeros(3))
    reach = cast_rays(grid, np.asarray(pose), BEARINGS, 20.0)[0]
    reach = reach + rng.normal(0.0, noise_m, len(reach))
    return np.column_stack([reach * np.cos(BEARINGS), reach * np.sin(BEARINGS)])


def corridor(rng, length_m=30.0, noise_m=NOISE_M):
    """Both walls of a corridor along x, 2 m wide, from its middle."""
    x = rng.uniform(-length_m / 2.0, length_m / 2.0, 600)
    side = rng.choice([-1.0, 1.0], 600)
    return np.column_stack([x, side + rng.normal(0.0, noise_m, 600)])


@pytest.mark.parametrize("seed", range(4))
def test_a_scan_finds_its_place_in_another(seed):
    rng = np.random.default_rng(seed)
    first = np.array([3.7, 6.1, 0.7])
    move = np.array([0.2, -0.15, 0.1])
    target = line_target(scan_at(first, rng))

    found = icp(target, scan_at(se2.compose(first, move), rng), np.zeros(3))

    assert found.converged
    assert np.hypot(*(found.xyyaw - move)[:2]) < 0.006
    assert abs(found.xyyaw[2] - move[2]) < 0.002
    assert found.observed.all()
    assert found.inliers > 0.85
    assert found.rms_m == pytest.approx(NOISE_M, rel=0.4)


def test_errors_are_as_large_as_the_covariance_says():
    rng = np.random.default_rng(11)
    first, nees = np.array([3.7, 6.1, 0.7]), []
    for _ in range(60):
        move = rng.uniform(-0.1, 0.1, 3)
        target = line_target(scan_at(first, rng))
        found = icp(target, scan_at(se2.compose(first, move), rng), np.zeros(3))
        error = found.xyyaw - move
        nees.append(error @ found.information @ error)
        np.testing.assert_allclose(found.covariance @ found.information, np.eye(3), atol=1e-6)

    # 3 is expected; without the noise of the target's own lines it is twice that.
    assert 2.0 < np.mean(nees) < 4.5


@pytest.mark.parametrize("noise_m", [0.01, 0.03])
def test_along_a_corridor_the_guess_stays(noise_m):
    rng = np.random.default_rng(3)
    target = line_target(corridor(rng, noise_m=noise_m))
    guess = np.array([0.4, 0.1, 0.05])

    found = icp(target, corridor(rng, noise_m=noise_m), guess)

    assert found.observed.tolist() == [False, True, True]
    assert abs(found.directions[0, 0]) > 0.999
    assert found.xyyaw[0] == pytest.approx(0.4, abs=0.02)
    assert np.abs(found.xyyaw[1:]).max() < 0.005
    assert abs(found.information[0, 0]) < 1e-3 * found.information[1, 1]
    assert found.covariance is None


def test_the_end_of_a_corridor_is_seen():
    rng = np.random.default_rng(3)
    y = np.linspace(-1.0, 1.0, 40)

    def ended(shift):
        end = np.column_stack([15.0 + rng.normal(0.0, NOISE_M, 40), y])
        return np.concatenate([corridor(rng), end]) - np.array([shift, 0.0])

    found = icp(line_target(ended(0.0)), ended(0.2), np.zeros(3))

    assert found.observed.all()
    assert found.xyyaw[0] == pytest.approx(0.2, abs=0.01)


def test_people_do_not_move_the_match():
    rng = np.random.default_rng(5)
    first, move = np.array([3.7, 6.1, 0.7]), np.array([0.1, 0.1, 0.05])
    points = scan_at(se2.compose(first, move), rng)
    points[40:140] *= 0.7

    found = icp(line_target(scan_at(first, rng)), points, np.zeros(3))

    assert np.hypot(*(found.xyyaw - move)[:2]) < 0.008
    assert found.inliers < 0.85


def test_a_map_of_points_serves_many_scans():
    rng = np.random.default_rng(6)
    poses = [np.array([3.7, 6.1, a]) for a in (0.0, 2.0, 4.0)]
    world = np.concatenate([se2.transform_points(p, scan_at(p, rng)) for p in poses])
    target = line_target(world)

    for pose in (np.array([3.9, 6.0, 1.0]), np.array([3.5, 6.3, -2.5])):
        found = icp(target, scan_at(pose, rng), pose + np.array([0.15, -0.1, 0.08]))
        assert np.abs(se2.between(pose, found.xyyaw)).max() < 0.006


@pytest.mark.parametrize("points", [np.empty((0, 2)), np.array([[50.0, 50.0], [51.0, 50.0]])])
def test_nothing_in_common_leaves_the_guess(points):
    rng = np.random.default_rng(7)
    guess = np.array([1.0, 2.0, 0.3])

    found = icp(line_target(scan_at((3.7, 6.1, 0.7), rng)), points, guess)

    assert found.xyyaw == pytest.approx(guess, abs=1e-12)
    assert not found.observed.any()
    assert found.inliers == 0.0
    assert not found.information.any()
    assert not icp(line_target(np.empty((0, 2))), scan_at((3, 6, 0), rng), guess).observed.any()


def test_lines_are_laid_through_neighbours():
    rng = np.random.default_rng(8)
    along = rng.uniform(-3.0, 3.0, 500)
    points = np.column_stack([along, rng.normal(0.0, NOISE_M, 500)])
    turned = se2.transform_points(np.array([1.0, 2.0, 0.6]), points)

    target = line_target(np.concatenate([turned, [[90.0, 90.0]]]))

    assert 50 <= len(target.points) <= 150
    on_line = target.points - target.off[:, None] * target.normals
    off = se2.transform_points(se2.inverse(np.array([1.0, 2.0, 0.6])), on_line)
    assert np.abs(off[:, 1]).max() < NOISE_M
    angle = np.arctan2(target.normals[:, 1], target.normals[:, 0]) - 0.6
    angle = np.mod(angle, np.pi) - np.pi / 2.0
    assert np.mean(angle**2 / target.variance) == pytest.approx(1.0, abs=0.6)


def test_every_line_stands_in_its_cell():
    rng = np.random.default_rng(9)
    points = rng.normal(0.0, 0.3, (300, 2)) * np.array([1.0, 0.02])
    target = line_target(points)
    rows, cols = np.nonzero(target.index >= 0)
    assert len(rows) == len(target.points) > 10
    assert sorted(target.index[rows, cols]) == list(range(len(rows)))
    at = ((points - target.corner_xy) / target.cell_m).astype(int)
    for row, col in zip(rows, cols, strict=True):
        k = target.index[row, col]
        mean = points[(at == [col, row]).all(axis=1)].mean(axis=0)
        np.testing.assert_allclose(target.points[k], mean, atol=1e-12)
        near = points[(np.abs(at - [col, row]) <= 1).all(axis=1)]
        if len(near) >= 6:
            off = target.normals[k] @ (mean - near.mean(axis=0))
            assert target.off[k] == pytest.approx(off, abs=1e-12)


@given(seed=st.integers(0, 10**6), reach=st.sampled_from([0.05, 0.4, 2.0]))
@settings(max_examples=20, deadline=None)
def test_the_nearest_point_is_the_nearest(seed, reach):
    rng = np.random.default_rng(seed)
    line = rng.uniform(-1.0, 1.0, (60, 1)) * rng.normal(size=2) + rng.normal(0, 0.01, (60, 2))
    target = line_target(line)
    frame = (target.cell_m, target.corner_xy[0], target.corner_xy[1])
    for x, y in rng.uniform(-1.5, 1.5, (30, 2)):
        before = int(rng.integers(-1, len(target.points)))
        found = nearest(target.points, target.index, frame, x, y, reach, before)
        if not len(target.points):
            assert found == -1
            continue
        distance, index = cKDTree(target.points).query([x, y])
        assert found == (index if distance < reach else -1)


def test_axes_are_eigenvectors():
    rng = np.random.default_rng(10)
    for _ in range(20):
        root = rng.normal(size=(3, 3))
        out = np.zeros((4, 3, 3))
        out[0] = root @ root.T
        axes(out, np.zeros((3, 3)), 1e-3)

        values, vectors = np.linalg.eigh(out[0])
        np.testing.assert_allclose(out[3, 1], values, atol=1e-12)
        np.testing.assert_allclose(np.abs(out[2] @ vectors), np.eye(3), atol=1e-7)


def test_settings_are_heeded():
    rng = np.random.default_rng(12)
    first, move = np.array([3.7, 6.1, 0.7]), np.array([0.1, 0.1, 0.05])
    target, points = line_target(scan_at(first, rng)), scan_at(se2.compose(first, move), rng)

    one = icp(target, points, np.zeros(3), IcpSettings(most_steps=1))
    whole = icp(target, points, np.zeros(3), IcpSettings(stride=1))

    assert (one.steps, one.converged) == (1, False)
    assert np.hypot(*(whole.xyyaw - move)[:2]) < 0.006


def test_the_sums_are_compiled_once():
    points = scan_at((3.7, 6.1, 0.7), np.random.default_rng(0))
    icp(line_target(points), points, np.zeros(3))

    # None where the whole came from the cache.
    assert len(sum_up.signatures) <= 1


def test_open3d_finds_the_same_place():
    rng = np.random.default_rng(13)
    first, move = np.array([3.7, 6.1, 0.7]), np.array([0.1, 0.1, 0.05])
    target, points = line_target(scan_at(first, rng)), scan_at(se2.compose(first, move), rng)
    try:
        theirs = icp_open3d(target, points, np.zeros(3))
    except NotApplicableError as error:
        pytest.skip(str(error))

    ours = icp(target, points, np.zeros(3))

    assert theirs.converged
    assert np.hypot(*(theirs.xyyaw - move)[:2]) < 0.01
    np.testing.assert_allclose(theirs.information, ours.information, rtol=0.3, atol=2e3)
    nowhere = icp_open3d(target, np.empty((0, 2)), np.zeros(3))
    assert not nowhere.converged
    assert not nowhere.observed.any()


def test_open3d_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    target = line_target(scan_at((3.7, 6.1, 0.7), np.random.default_rng(0)))

    with pytest.raises(NotApplicableError, match="Open3D cannot be loaded"):
        icp_open3d(target, np.ones((3, 2)), np.zeros(3))
