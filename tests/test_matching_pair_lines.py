"""Scans laid on each other by their lines: one step for many pairs."""

import numpy as np
import pytest

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.pair_lines import ScanLines, lay_pairs
from slamreplay.testing.synthetic import room_grid

BEARINGS = np.linspace(-2.3, 2.3, 300)


def seen_from(world, pose, rng=None, reach=30.0):
    """Points and normals of a scan from a pose of the laser, which is the base here."""
    ranges = cast_rays(world, pose[None], BEARINGS, reach)[0]
    hit = ranges < reach
    ranges = ranges + (0.0 if rng is None else rng.normal(0.0, 0.01, len(ranges)))
    points = (ranges[:, None] * np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS)]))[hit]
    k = np.arange(len(points))
    along = points[np.minimum(k + 5, len(k) - 1)] - points[np.maximum(k - 5, 0)]
    normals = np.column_stack([-along[:, 1], along[:, 0]])
    normals /= np.hypot(*normals.T)[:, None]
    towards = np.sign(-(normals * points).sum(axis=1))
    return points, normals * towards[:, None]


def lines_of(world, poses, rng=None):
    scans = [seen_from(world, pose, rng) for pose in poses]
    return ScanLines.of([p for p, _ in scans], [n for _, n in scans], np.zeros(2))


def laid(lines, guess, rounds=6):
    pairs = np.array([[0, 1]])
    xyyaw = guess[None]
    for k in range(rounds):
        found = lay_pairs(lines, pairs, xyyaw, 0.4 / (k + 1) + 0.1, 0.2 / (k + 1))
        xyyaw = found.xyyaw
    return found


def test_steps_end_where_the_second_scan_was_taken():
    world = room_grid()
    poses = se2.compose(world.origin_xyyaw, np.array([[3.0, 3.0, 0.4], [3.6, 3.3, 0.9]]))
    lines = lines_of(world, poses, np.random.default_rng(1))
    truth = se2.between(poses[0], poses[1])

    found = laid(lines, se2.compose(truth, np.array([0.12, -0.1, 0.05])))

    assert found.xyyaw[0] == pytest.approx(truth, abs=0.01)
    assert found.share[0] > 0.7
    assert found.rms_m[0] < 0.02


def test_a_corridor_holds_nothing_along_itself():
    cells = np.zeros((60, 2400), dtype=np.int8)
    cells[[0, -1]] = 100
    world = OccupancyGrid(cells, 0.05, np.zeros(3))
    poses = np.array([[60.0, 1.4, 0.0], [60.5, 1.6, 0.1]])
    lines = lines_of(world, poses, np.random.default_rng(2))
    guess = se2.compose(se2.between(poses[0], poses[1]), np.array([0.2, 0.0, 0.0]))

    found = laid(lines, guess, rounds=3)

    information = found.per_point[0]
    assert information[0, 0] < 0.02 * information[1, 1]
    assert found.xyyaw[0, 0] == pytest.approx(guess[0], abs=0.05)  # it stays where it was put
    assert found.xyyaw[0, 1] == pytest.approx(0.2, abs=0.02)


def test_scans_that_share_nothing_have_no_partners():
    world = room_grid()
    poses = se2.compose(world.origin_xyyaw, np.array([[3.0, 3.0, 0.0], [3.0, 3.0, 0.0]]))
    lines = lines_of(world, poses)

    found = lay_pairs(lines, np.array([[0, 1]]), np.array([[80.0, 0.0, 0.0]]), 0.3, 0.1)

    assert found.share[0] == 0.0
    assert found.per_point[0] == pytest.approx(np.zeros((3, 3)))
    assert found.xyyaw[0] == pytest.approx([80.0, 0.0, 0.0])


def test_partners_are_the_nearest_ones_all_round():
    """Of scattered points without lines: as many partners as a search of all of them finds."""
    rng = np.random.default_rng(3)
    clouds = [rng.uniform(-3.0, 3.0, (120, 2)) for _ in range(2)]
    lines = ScanLines.of(clouds, [np.zeros((120, 2))] * 2, np.array([0.3, -0.2]))
    pose, reach = np.array([0.4, -0.7, 2.9]), 0.35

    found = lay_pairs(lines, np.array([[0, 1]]), pose[None], reach, 0.1)

    there = se2.transform_points(pose, clouds[1])
    nearest = np.hypot(*(there[:, None] - clouds[0][None]).transpose(2, 0, 1)).min(axis=1)
    assert found.share[0] == pytest.approx((nearest < reach).mean())
