"""Two equal bays, and the words for what a localizer believed in them."""

import numpy as np
import pytest

from slamreplay.labs.two_run.trials import Course, Motion
from slamreplay.simulate.alike import BAY_LENGTH_M, BAY_PITCH_M, twin_bays
from slamreplay.simulate.worlds import rasterise


def test_the_bays_are_equal_and_the_passage_is_not():
    grid = rasterise(twin_bays(), 0.05, as_map=True)
    rows = round(BAY_PITCH_M / 0.05)
    first, last = grid.cell_of(np.array([[0.025, 0.025], [BAY_LENGTH_M - 0.025, 4.975]]))
    lower = grid.cells[first[0] : last[0] + 1, first[1] : last[1] + 1]
    upper = grid.cells[first[0] + rows : last[0] + rows + 1, first[1] : last[1] + 1]

    assert (lower == upper).all()
    assert not (grid.cells[:-rows, last[1] + 1 :] == grid.cells[rows:, last[1] + 1 :]).all()


def course(tight, right, motions=(), credible_s=None):
    n = len(tight)
    nothing = np.zeros((n, 3))
    return Course(
        np.arange(n) * 1.0, nothing, nothing, np.ones(n), np.array(tight, dtype=bool),
        np.array(right, dtype=bool), motions, credible_s, 0.0,
    )  # fmt: skip


def test_collapsed_is_tight_and_wrong():
    found = course([0, 1, 1, 0, 1, 1], [0, 0, 0, 0, 1, 1])

    assert found.collapsed_s == pytest.approx(2.0)
    assert found.wrong_s == pytest.approx(4.0)
    assert found.wrong_until_s == pytest.approx(3.0)


def test_motions_wait_until_the_belief_is_credible():
    early = Motion(1.0, 0.1, 0.5, error_m=6.0, allowed=True)
    late = Motion(5.0, 0.1, 0.5, error_m=0.0, allowed=True)

    assert course([1] * 6, [1] * 6, (early, late), 4.0).waiting == (early,)
    assert course([1] * 6, [1] * 6, (early, late), None).waiting == (early, late)
    assert early.deceived
    assert not late.deceived
    assert not Motion(1.0, 5.0, 0.5, error_m=6.0, allowed=False).deceived
