"""Odometry, gyroscope and commands that tell one motion in other units or hands."""

import numpy as np
import pytest

from slamreplay.audit.motion_units import motion_ratios
from slamreplay.consistency.audits.motion_units import check
from slamreplay.consistency.context import CheckContext
from slamreplay.perturb import PERTURBATIONS
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.drive import Follow, Pause
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.worlds import warehouse


@pytest.fixture(scope="module")
def view():
    hall = warehouse()
    tour = (Pause(0.5), Follow(((2.6, 1.2), (2.0, 4.6))), Follow(((2.0, 7.0), (4.0, 8.0))))
    return bundle_of(record(Scenario(hall, hall, (1.5, 1.3, 0.0), tour, "healthy", 1))).view()


def found(view, name):
    short, _, variant = name.partition(".")
    changed = PERTURBATIONS.load(short)().apply(view, variant, 1.0, np.random.default_rng(1))
    return check(CheckContext(None, (), changed))


def test_a_sound_log_tells_one_motion(view):
    assert check(CheckContext(None, (), view)) == ()
    ratios = motion_ratios(view)
    assert len(ratios) == 4
    assert all(r.ratio == pytest.approx(1.0, abs=0.1) for r in ratios), ratios


@pytest.mark.parametrize(
    ("name", "says", "against"),
    [
        ("unit_error.odometry_mm_as_m", "millimetres", ""),
        ("unit_error.imu_deg_as_rad", "degrees", "gyroscope"),
        ("unit_error.imu_rad_as_deg", "degrees", "gyroscope"),
        ("unit_error.odometry_deg_as_rad", "degrees", "odometry"),
        ("unit_error.odometry_rad_as_deg", "degrees", "odometry"),
        ("handedness.odometry", "left and right", "odometry"),
        ("handedness.odometry_yaw", "left and right", "odometry"),
        ("handedness.imu_yaw", "left and right", "gyroscope"),
    ],
)
def test_the_unit_and_who_has_it_are_named(view, name, says, against):
    (finding,) = found(view, name)

    assert finding.id == "SR-ODO-003"
    assert says in finding.message
    assert finding.message.endswith(f"against {against}") or not against


def test_what_it_cannot_see_is_not_accused(view):
    for name in ("handedness.scan_order", "handedness.odometry_y", "unit_error.scan_mm_as_m"):
        assert found(view, name) == ()
