"""A submap that sees little of the map is placed by the motion, not by luck."""

import numpy as np
import pytest

from slamreplay.hindsight.heirs import with_heirs
from slamreplay.hindsight.places import JUMP_DOUBTFUL, Hypotheses, best_places
from slamreplay.hindsight.submaps import Submap
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.field import working_map
from slamreplay.matching.whole_map import search_space
from slamreplay.testing.synthetic import room_grid

BEARINGS = np.linspace(-np.pi, np.pi, 180, endpoint=False)
FIRST, STEP = np.array([1.6, 1.6, 0.0]), np.array([0.8, 0.0, 0.2])
SECOND = np.array([2.4, 1.6, 0.2])
LUCK = np.array([[3.4, 3.0, 2.0], [1.2, 3.1, -1.0]])


def test_both_sides_of_a_jump_are_asked_where_the_motion_leads():
    grid = room_grid()
    working = working_map(grid)
    space = search_space(working, working.field(0.12))
    reach = cast_rays(grid, working.to_map(np.array([FIRST, SECOND])), BEARINGS, 20.0)
    ends = reach[..., None] * np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS)])
    found = [Submap(k, k + 1, k, ends[k], np.zeros((0, 4))) for k in range(2)]
    lists = [
        Hypotheses(FIRST[None], np.array([0.95])),
        Hypotheses(LUCK, np.array([0.7, 0.6])),
    ]
    motions, cost = STEP[None], np.array([JUMP_DOUBTFUL])
    assert best_places(lists, motions, cost).jumps.tolist() == [True]

    wider = with_heirs(space, working, found, lists, motions, cost)

    best = best_places(wider, motions, cost)
    assert best.jumps.tolist() == [False]
    np.testing.assert_allclose(best.xyyaw, [FIRST, SECOND], atol=0.05)


@pytest.mark.parametrize(("chance", "jumps"), [(-np.inf, True), (0.45, False)])
def test_a_place_no_better_than_chance_is_worth_no_jump(chance, jumps):
    lists = [
        Hypotheses(np.zeros((1, 3)), np.array([0.9])),
        Hypotheses(np.array([[1.0, 0.0, 0.0], [9.0, 5.0, 2.0]]), np.array([0.2, 0.5]), chance),
    ]
    found = best_places(lists, np.array([[1.0, 0.0, 0.0]]), np.array([JUMP_DOUBTFUL]))

    assert found.jumps.tolist() == [jumps]
    assert found.score[1] == (0.5 if jumps else 0.2)
