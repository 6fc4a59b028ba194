"""Confusions of units and hands: the log that is judged is the confused one, and what is told."""

import pytest

from slamreplay.labs.units_and_handedness.lab import UnitsAndHandedness
from slamreplay.labs.units_and_handedness.pages import results
from slamreplay.labs.units_and_handedness.trials import Confused, Ran, confused
from slamreplay.perturb import PERTURBATIONS
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import scenario


@pytest.fixture(scope="module")
def recording():
    return record(scenario("healthy_short"))


@pytest.mark.parametrize(
    ("name", "state"),
    [(None, "healthy"), ("handedness.map_rows", "insufficient_data")],
)
def test_what_is_judged_is_the_confused_log(recording, name, state):
    found = confused(name, bundle_of(recording), recording, (), 1)

    assert found.state == state
    assert ("SR-MAP-WRONG" in found.report) == (name is not None)


def test_every_confusion_of_the_families_may_be_asked_and_no_other():
    names = [
        f"{f}.{v}" for f in ("unit_error", "handedness") for v in PERTURBATIONS.load(f).variants
    ]
    assert UnitsAndHandedness(confusions=names, estimators=["ekf"]).confusions == names
    with pytest.raises(ValueError, match="no confusion"):
        UnitsAndHandedness(confusions=["tf_delay.odometry"], estimators=["ekf"])


def test_cells_tell_what_is_new_beside_the_log_as_it_is():
    whole = Confused({"ekf": Ran(0.1, 1.0, None)}, "healthy", "none", ("SR-TF-004",), (), ())
    broken = Confused({"ekf": Ran(None, None, 0.0)}, "lost", "odometry_slip",
                      ("SR-ODO-003", "SR-TF-004"), (), ("in degrees",))  # fmt: skip
    found = results({None: whole, "unit_error.imu_deg_as_rad": broken})
    numbers = found.numbers["confusions"]["unit_error.imu_deg_as_rad"]

    assert numbers["inspect"] == ["SR-ODO-003"]
    assert found.tables[0].rows[1][1:] == (
        "no pose", "lost: odometry slip", "ODO-003", "nothing", "yes",
    )  # fmt: skip
