"""Random places can be driven through, and every new option of the simulator does what it says."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.simulate.drive import Carry, Follow, drive
from slamreplay.simulate.halls import random_warehouse, repeated_aisles, transposed
from slamreplay.simulate.offices import random_office
from slamreplay.simulate.people import Walker, ranges_to
from slamreplay.simulate.routes import CLEARANCE_M, Floor, random_route
from slamreplay.simulate.worlds import rasterise, redrawn


def rng_of(seed):
    return np.random.Generator(np.random.PCG64(seed))


@cache
def place(make, seed):
    return make(rng_of(seed))


@pytest.mark.parametrize("make", [random_warehouse, random_office])
@pytest.mark.parametrize("seed", [0, 3])
def test_random_place_can_be_driven_without_touching_anything(make, seed):
    world = place(make, seed)
    floor = Floor.of(world)
    rng = rng_of(seed)
    start = floor.random_place(rng, 0.8)

    legs = random_route(floor, rng, start, 30.0)
    motion = drive((*start, 0.0), tuple(Follow(leg) for leg in legs))

    assert np.hypot(*np.diff(motion.xyyaw[:, :2], axis=0).T).sum() > 20.0
    assert floor.at(motion.xyyaw[:, :2]).min() > 0.3
    assert 11.0 <= world.bounds[2] <= 40.0
    assert 11.0 <= world.bounds[3] <= 40.0


def test_seed_decides_the_place():
    assert random_warehouse(rng_of(4)) == random_warehouse(rng_of(4))
    assert random_warehouse(rng_of(4)) != random_warehouse(rng_of(5))
    assert random_office(rng_of(4)) == random_office(rng_of(4))


def test_hall_of_a_hundred_metres():
    world = random_warehouse(rng_of(0), (100.0, 100.0))

    assert world.bounds == (0.0, 0.0, 100.0, 100.0)
    assert sum(s.name.startswith("rack") for s in world.solids) > 100


def test_aisles_repeat_but_not_quite():
    world, pitch = repeated_aisles(rng_of(1))
    grid = rasterise(world, 0.05, as_map=False)
    up = round(pitch / 0.05)
    one, next_one = grid.occupied[:-up], grid.occupied[up:]
    inside = slice(round(3.5 / 0.05), -round(3.5 / 0.05))

    same = (one == next_one)[inside, inside].mean()

    assert 0.9 < same < 0.999


def test_transposed_place_keeps_its_outlines_anticlockwise():
    world = transposed(place(random_warehouse, 0))
    for solid in world.solids:
        x, y = np.array(solid.corners).T
        area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
        assert area > 0.0


def test_ways_keep_their_distance_and_lead_where_they_say():
    floor = Floor.of(place(random_warehouse, 0))
    start = floor.random_place(rng_of(1))
    ways = floor.ways(start)
    goal = int(ways.within(10.0, 14.0)[0])

    corners = np.array([start, *ways.to(goal)])

    np.testing.assert_allclose(corners[-1], ways.centres[goal])
    assert all(floor.sees(a, b) for a, b in pairwise(corners[1:]))
    assert floor.at(corners).min() >= CLEARANCE_M - 1e-9


def test_redrawn_map_is_the_same_place_in_another_frame():
    cells = np.zeros((40, 60), dtype=np.int8)
    cells[10:14, 20:50] = 100
    grid = OccupancyGrid(cells, 0.1, np.array([-1.0, 2.0, 0.0]))
    frame = np.array([3.0, -1.0, 0.4])
    points = np.array([[2.5, 3.2], [0.0, 3.2], [2.5, 4.0]])

    new = redrawn(grid, frame)
    there = new.cell_of(se2.transform_points(frame, points))

    assert new.origin_xyyaw[2] == 0.0
    assert new.cells[there[:, 0], there[:, 1]].tolist() == [100, 0, 0]
    assert new.occupied.sum() == pytest.approx(grid.occupied.sum(), rel=0.05)


def test_push_with_turning_wheels_is_half_told_by_them():
    motion = drive((0.0, 0.0, 0.0), (Carry((2.0, 0.0, 0.0), 2.0, wheels=0.5),))

    assert np.trapezoid(motion.wheels[:, 0], motion.t_s) == pytest.approx(1.0, abs=0.02)


def test_pallet_is_wider_than_who_pushes_it():
    pallet = Walker(((2.0, 0.0), (2.0, 4.0)), 1.0, radius_m=0.5)

    assert ranges_to((pallet,), np.zeros(1), np.zeros((1, 3))) == pytest.approx([1.5])
