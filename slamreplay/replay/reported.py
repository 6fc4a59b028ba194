"""What a perturbation changes of an estimate itself, whoever gave it: nothing is run again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from slamreplay.bundle.run import Estimate

#: The covariance of every pose, times this.
POSE_COVARIANCE = "pose_covariance_scale"
#: Settings that no estimator needs to know.
REPORTED = frozenset({POSE_COVARIANCE})


def as_reported(estimate: Estimate, settings: Mapping[str, float]) -> Estimate:
    """The estimate as a view's settings have it given out; poses and ledger are the estimator's."""
    if POSE_COVARIANCE not in settings:
        return estimate
    track = estimate.track
    return replace(estimate, track=replace(track, cov=settings[POSE_COVARIANCE] * track.cov))
