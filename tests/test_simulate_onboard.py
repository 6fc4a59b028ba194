"""The inner loops of the filter on board do what plain numpy does."""

import numpy as np

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.simulate import onboard_kernels

ROOM = OccupancyGrid(np.zeros((160, 200), dtype=np.int8), 0.05, np.array([-3.0, 2.0, 0.4]))


def particles(n: int = 300) -> np.ndarray:
    here = se2.compose(ROOM.origin_xyyaw, np.array([4.0, 4.0, 0.0]))
    return here + np.random.default_rng(1).normal(0.0, [1.5, 1.5, 2.0], (n, 3))


def test_move_equals_plain_numpy():
    before, noise = particles(), np.random.default_rng(2).normal(size=(300, 3))
    motion, sigma = np.array([0.3, 0.5, -0.2]), np.array([0.1, 0.05, 0.2])

    after = before.copy()
    onboard_kernels.move(after, motion, sigma, noise)

    turn1, distance, turn2 = (motion - sigma * noise).T
    heading = before[:, 2] + turn1
    x = before[:, 0] + distance * np.cos(heading)
    y = before[:, 1] + distance * np.sin(heading)
    expected = np.column_stack([x, y, se2.wrap_angle(heading + turn2)])
    np.testing.assert_allclose(after, expected, atol=1e-12)


def test_likelihoods_equal_plain_numpy_in_a_turned_grid():
    cloud, ends = particles(), np.random.default_rng(3).normal(0.0, 4.0, (50, 2))
    scores = np.random.default_rng(4).random(ROOM.cells.shape).astype(np.float32)

    got = onboard_kernels.likelihoods(
        cloud,
        np.ascontiguousarray(ends.T),
        np.pad(scores, 1, constant_values=0.25),
        ROOM.origin_xyyaw,
        ROOM.resolution_m,
    )

    cell = ROOM.cell_of(se2.transform_points(cloud, np.broadcast_to(ends, (300, 50, 2))))
    inside = ROOM.inside(cell)
    cell[~inside] = 0
    score = np.where(inside, scores[cell[..., 0], cell[..., 1]], 0.25)
    assert inside.any()
    assert not inside.all()
    np.testing.assert_allclose(got, 1.0 + score.sum(axis=1), rtol=1e-6)
