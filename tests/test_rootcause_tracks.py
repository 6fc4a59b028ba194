"""Paths that are taken apart, mended and put together, and the density of what was seen."""

import numpy as np
from scipy import stats

from slamreplay.geometry import se2
from slamreplay.rootcause.likelihood import NU, student
from slamreplay.rootcause.tracks import filled, put_together, steps_of


def _path(n: int = 40) -> np.ndarray:
    rng = np.random.default_rng(0)
    steps = rng.normal((0.05, 0.0, 0.02), (0.02, 0.01, 0.1), (n - 1, 3))
    return put_together(np.array([1.0, 2.0, 3.0]), steps)


def test_steps_put_together_are_the_path() -> None:
    path = _path()
    again = put_together(path[0], steps_of(path))
    np.testing.assert_allclose(again[:, :2], path[:, :2], atol=1e-12)
    np.testing.assert_allclose(se2.wrap_angle(again[:, 2] - path[:, 2]), 0.0, atol=1e-12)


def test_a_gap_is_filled_by_odometry_and_by_what_it_missed() -> None:
    path = _path()
    t_ns = np.arange(len(path)) * 100_000_000
    odometry = se2.compose(np.array([5.0, -1.0, 0.4]), path)
    holed = path.copy()
    holed[10:20] = np.nan
    np.testing.assert_allclose(filled(t_ns, holed, odometry)[:, :2], path[:, :2], atol=1e-9)
    carried = path.copy()  # the robot was somewhere else when it was seen again
    carried[20:] = se2.compose(np.array([2.0, 0.0, 0.0]), path[20:])
    carried[10:20] = np.nan
    x = filled(t_ns, carried, odometry)[10:20, 0] - path[10:20, 0]
    assert 0.0 < x[0] < x[5] < x[-1] < 2.0


def test_without_odometry_a_gap_is_filled_straight() -> None:
    path = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    holed = path.copy()
    holed[2] = np.nan
    filled_in = filled(np.arange(5) * 10, holed, np.full((5, 3), np.nan))
    np.testing.assert_allclose(filled_in, path, atol=1e-12)


def test_the_density_is_a_student_t() -> None:
    r = np.array([0.0, 0.3, 2.0, 9.0])
    np.testing.assert_allclose(student(r, 1), stats.t(NU).logpdf(r))
    two = stats.multivariate_t(np.zeros(2), np.eye(2), df=NU)
    np.testing.assert_allclose(student(r, 2), [two.logpdf([x, 0.0]) for x in r])
