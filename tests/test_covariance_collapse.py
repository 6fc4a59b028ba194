"""Process noise told too low: how often somebody looks, and what is counted of who finds it."""

import numpy as np
import pytest

from slamreplay.labs.covariance_collapse.drive import log_of, seen_every
from slamreplay.labs.covariance_collapse.pages import results
from slamreplay.labs.covariance_collapse.trials import Claim, claim_of
from slamreplay.simulate.codes import CodeFloor
from slamreplay.simulate.drive import Follow, Pause
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.worlds import warehouse


@pytest.fixture(scope="module")
def recording():
    hall = warehouse()
    floor = CodeFloor((2.0, 1.2), columns=8, rows=1, spacing_m=1.0, worn=0.0, misread=0.0)
    tour = (Pause(0.5), Follow(((9.0, 1.2),)), Pause(0.5))
    return record(Scenario(hall, hall, (1.5, 1.25, 0.0), tour, "healthy", 1, floor=floor))


@pytest.fixture(scope="module")
def bundle(recording):
    return log_of(recording)


def test_the_log_starts_at_a_dock_and_holds_no_truth(bundle):
    start = bundle.table("initial_poses")["covariance"][0].reshape(6, 6)

    assert np.sqrt(np.diag(start)[[0, 1, 5]]) == pytest.approx([0.08, 0.08, 0.03])
    assert set(bundle.table("references")["kind"]) == {"fiducial"}


def test_a_code_is_seen_as_often_as_asked_and_all_sightings_of_it_stay(bundle):
    every = bundle.table("references").t_ns
    few = seen_every(bundle, 4.0).table("references").t_ns
    starts = few[np.concatenate([[True], np.diff(few) > 5e8])]

    assert 1 < len(starts) < len(every)
    assert np.diff(starts).min() > 2e9
    assert set(few) < set(every)
    assert len(seen_every(bundle, None).table("references")) == 0


def test_less_noise_is_a_smaller_claim_of_the_same_error(bundle, recording):
    honest, tight = (
        claim_of("dead_reckoning", scale, bundle, recording, (None,), 1) for scale in (1.0, 0.001)
    )

    assert np.array_equal(honest.error_m, tight.error_m)
    assert (tight.sigma_m <= honest.sigma_m).all()
    assert tight.sigma_m[-1] < 0.9 * honest.sigma_m[-1]
    assert tight.largest_sigmas > honest.largest_sigmas
    assert not honest.found_s


def test_what_is_found_is_counted_by_check_and_interval():
    t_s = np.array([0.0, 1.0, 2.0])
    error, sigma = np.array([0.0, 0.5, 1.0]), np.array([0.1, 0.1, 0.2])
    runs = [
        Claim(t_s, error, sigma, {("SR-CON-010", 2.0): 1.0}, 3, 2, 1),
        Claim(t_s, 2.0 * error, sigma, {}, 3, 1, 0),
    ]
    numbers = results({("ekf", 0.1): runs}, (2.0, None)).numbers["estimators"]["ekf"]["0.1"]

    assert numbers["found"]["every 2 s"]["SR-CON-010"] == {"logs": 1, "from_s": 1.0}
    assert numbers["found"]["no reference"]["SR-CON-010"] == {"logs": 0, "from_s": None}
    assert (numbers["motions"], numbers["allowed"], numbers["deceived"]) == (6, 3, 1)
    assert numbers["largest_error_sigmas"] == pytest.approx(7.5)
