"""Rays equal those of the textbook's walk through the grid, to the last bit."""

import numpy as np
import plain_rays
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import _first_wall, cast_rays

#: Along the axes and the diagonals, where crossings of rows and columns coincide.
STRAIGHT = np.arange(-4, 5) * np.pi / 4.0


def plain(grid, poses, bearings, limit):
    local = se2.compose(se2.inverse(grid.origin_xyyaw), poses)
    out = np.empty((len(poses), len(bearings)))
    with np.errstate(divide="ignore"):
        plain_rays.cast(grid.occupied, grid.resolution_m, local, bearings, limit, out)
    return out


@given(
    seed=st.integers(0, 10**6),
    walls=st.sampled_from([0.0, 0.02, 0.2, 0.6]),
    limit=st.sampled_from([100.0, 0.7, 0.0]),
    turned=st.booleans(),
    centred=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_rays_are_those_of_the_plain_walk(seed, walls, limit, turned, centred):
    rng = np.random.default_rng(seed)
    shape = rng.integers(1, 40, 2)
    cells = np.where(rng.random(shape) < walls, 100, 0).astype(np.int8)
    origin = rng.normal(0.0, 1.0, 3) * turned
    grid = OccupancyGrid(cells, float(rng.choice([0.03, 0.05, 0.1])), origin)
    # Some rays start outside the map, some on the edges and in the middles of cells.
    xy = rng.uniform(-0.5, 1.5, (6, 2)) * shape[::-1]
    xy = np.floor(xy) + rng.choice([0.0, 0.5]) if centred else xy
    poses = np.column_stack([xy * grid.resolution_m, rng.choice([0.0, 0.3, np.pi / 4.0], 6)])
    bearings = np.concatenate([STRAIGHT, rng.uniform(-3.0, 3.0, 3)])

    found = cast_rays(grid, poses, bearings, limit)

    assert found.tobytes() == plain(grid, poses, bearings, limit).tobytes()


@pytest.mark.parametrize("seed", range(20))
def test_rays_through_corners_take_the_plain_walk_s_side(seed):
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((12, 12)) < 0.25, 100, 0).astype(np.int8)
    grid = OccupancyGrid(cells, 1.0, np.zeros(3))
    # No angle has a sine and cosine that are equal to the last bit.
    for dx, dy in 0.70710678 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]):
        for x, y in rng.integers(0, 12, (30, 2)) + rng.choice([0.0, 0.5]):
            expected = plain_rays.first_wall(grid.occupied, x, y, dx, dy, 40.0)
            assert _first_wall(grid.barred, x, y, dx, dy, 40.0) == expected


def test_a_ray_that_is_not_a_number_finds_nothing():
    grid = OccupancyGrid(np.eye(5, dtype=np.int8) * 100, 0.1, np.zeros(3))

    assert cast_rays(grid, np.array([0.25, 0.05, np.nan]), np.zeros(1), 9.0) == np.inf
    assert cast_rays(grid, np.array([np.nan, 0.05, 0.0]), np.zeros(1), 9.0) == np.inf
    assert cast_rays(grid, np.zeros((0, 3)), np.zeros(2), 9.0).shape == (0, 2)


def test_a_thin_wall_is_never_missed():
    cells = np.zeros((200, 200), dtype=np.int8)
    cells[:, 150] = 100
    grid = OccupancyGrid(cells, 0.05, np.zeros(3))
    bearings = np.linspace(-0.9, 0.9, 301)

    found = cast_rays(grid, np.array([[1.0, 5.0, 0.0]]), bearings, 50.0)[0]

    reaches = np.abs(5.0 + 6.5 * np.tan(bearings) - 5.0) < 4.99
    assert found[reaches] == pytest.approx(6.5 / np.cos(bearings[reaches]), abs=1e-9)
