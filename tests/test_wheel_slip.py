"""What is read off a course, and that AMCL's sigma answers a slip that nobody told it of."""

import numpy as np
import pytest

from slamreplay.labs.wheel_slip.drive import round_trip
from slamreplay.labs.wheel_slip.trials import Course, course_of, slip_of
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.drive import Slip


def test_a_course_is_read_at_the_last_scan_before():
    course = Course(np.arange(5.0), np.array([0.0, 1.0, 2.0, 3.0, 0.1]),
                    np.array([0.1, 0.2, 0.9, 0.9, 0.1]), ())  # fmt: skip

    assert course.sigma_at(1.5) == 0.2
    assert course.error_at(3.0) == 3.0
    assert course.widest(3.5) == (0.1, 4.0)
    assert course.widest(1.0) == (0.9, 2.0)
    assert course.honest_share(2.0) == pytest.approx(2 / 3)


def test_amcl_widens_in_the_slip_and_contracts_after_it():
    slipped, steady = (
        round_trip(given, 1) for given in (Slip(22.0, 5.0, grip=0.1, yaw_rate=0.05), None)
    )
    first, last = slip_of(slipped)
    with_slip, without = (
        course_of("amcl", bundle_of(made, suffix=".bag").view(), made, 1)
        for made in (slipped, steady)
    )

    assert last - first == pytest.approx(5.0, abs=0.1)
    assert with_slip.sigma_at(last) > 2.0 * with_slip.sigma_at(first)
    assert with_slip.widest(first)[0] > 4.0 * without.widest(first)[0]
    assert with_slip.sigma_m[-1] < 1.3 * with_slip.sigma_at(first)
    assert with_slip.honest_share(first) > 0.9


def test_the_pose_graph_widens_in_the_slip_and_contracts_at_the_closure():
    slipped = round_trip(Slip(22.0, 5.0, grip=0.1, yaw_rate=0.05), 1)
    course = course_of("pose_graph_online", bundle_of(slipped, suffix=".bag").view(), slipped, 0)
    first, last = slip_of(slipped)
    closure = next(t for t in course.closures_s if t > last)

    assert course.sigma_at(last) > 5.0 * course.sigma_at(first)
    assert course.sigma_at(closure + 0.5) < 0.2 * course.sigma_at(closure - 0.5)
    assert course.honest_share(first) == 1.0
    assert course.error_m.max() < 0.1
