"""A stretch that fits far better elsewhere is put there, and nothing else is moved."""

import numpy as np

from slamreplay.geometry import se2
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.reseating import reseated
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.field import working_map
from slamreplay.matching.whole_map import search_space
from slamreplay.testing.synthetic import room_grid

BEARINGS = np.linspace(-np.pi, np.pi, 180, endpoint=False)
TRUE = np.column_stack([np.linspace(1.5, 3.5, 6), np.full(6, 1.6), np.linspace(0.0, 0.4, 6)])


def scanned(grid, poses):
    reach = cast_rays(grid, poses, BEARINGS, 20.0)
    ends = [r[:, None] * np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS)]) for r in reach]
    return [e[np.isfinite(e).all(axis=1)] for e in ends]


def asked(poses, score):
    grid = room_grid()
    working = working_map(grid)
    space = search_space(working, working.field(0.12))
    chain = Chain(TRUE, np.ones(6), np.zeros(6, bool), np.ones(6, bool), np.zeros((6, 3, 3)))
    points = scanned(grid, working.to_map(TRUE))
    return reseated(space, points, poses, chain, np.zeros(5, bool), np.array(score), 0.9)


def test_stretch_that_fits_elsewhere_is_put_there_and_its_link_opens():
    wrong = TRUE.copy()
    wrong[:2] = se2.compose(np.array([1.7, 2.1, 0.9]), TRUE[:2])

    poses, is_open = asked(wrong, [0.2, 0.2, 0.95, 0.95, 0.95, 0.95])

    assert np.abs(poses - TRUE)[:, :2].max() < 0.1
    assert is_open.tolist() == [False, True, False, False, False]


def test_poor_stretch_that_fits_nowhere_better_stays():
    assert asked(TRUE, [0.2, 0.2, 0.95, 0.95, 0.95, 0.95]) is None


def test_stretch_that_fits_is_not_asked():
    wrong = TRUE.copy()
    wrong[:2] = se2.compose(np.array([1.7, 2.1, 0.9]), TRUE[:2])

    assert asked(wrong, [0.95] * 6) is None
