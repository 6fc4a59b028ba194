"""The filter on a real robot among surveyed landmarks, held against motion capture."""

import numpy as np
import pytest

from slamreplay.consistency.evidence.nees import nees
from slamreplay.estimators.ekf.estimator import Ekf, EkfTuned
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.replay.metrics import judging_reference


@pytest.fixture(scope="module")
def log(real_logs, tmp_path_factory):
    folder = real_logs / "mrclam6"
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    return ingest([folder], tmp_path_factory.mktemp("m") / "b", IngestOptions(robot="1"))


@pytest.fixture(scope="module")
def found(log):
    """Distance to the reference (rmse, m) and mean NEES, by estimator; and the estimates."""
    reference, numbers, estimates = judging_reference(log), {}, {}
    for estimator in (Ekf(), EkfTuned()):
        estimate = estimator.run(log.view(), seed=0)
        held = nees(estimate.track, reference)
        error = held.error[np.isfinite(held.error).all(axis=1)]
        rmse = float(np.sqrt(np.mean(np.sum(error[:, :2] ** 2, axis=1))))
        numbers[estimator.name] = rmse, held.summary().test.mean
        estimates[estimator.name] = estimate
    return numbers, estimates


def test_a_robot_among_landmarks_is_followed_without_any_start(found):
    numbers, estimates = found

    assert numbers["ekf"][0] < 0.2
    assert estimates["ekf"].scalars["located_by_sightings"] == 1
    assert estimates["ekf"].track.has_pose.mean() > 0.98


def test_tuning_makes_it_better_and_innovations_news(found):
    numbers, estimates = found

    assert numbers["ekf_tuned"][0] < 0.9 * numbers["ekf"][0]
    for name, low, high in (("ekf", 0.3, 0.7), ("ekf_tuned", -0.15, 0.15)):
        (seen,) = estimates[name].innovations
        kept = seen.residual[seen.accepted, 0] / np.sqrt(seen.S[seen.accepted, 0, 0])
        assert low < np.mean(kept[1:] * kept[:-1]) / np.mean(kept**2) < high


def test_ranges_that_are_depths_and_commands_that_lead_are_found(found):
    """Innovations alone say so; motion capture agrees (0.46 and 0.2 s)."""
    scalars = found[1]["ekf_tuned"].scalars

    assert scalars["fitted.range_falloff"] == pytest.approx(0.5, abs=0.1)
    assert 0.1 < scalars["fitted.odometry_delay_s"] < 0.3
    assert scalars["sightings_rejected"] < found[1]["ekf"].scalars["sightings_rejected"]
