"""What a run was worth against hindsight, and whether its covariance was honest."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.run import Run
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.belief.credibility import nees_of_belief
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.nees import nees
from slamreplay.verdict.limits import Limits

_NAMES = (
    "hindsight_rmse_m",
    "hindsight_max_m",
    "hindsight_max_rad",
    "lost_share",
    "nees_mean",
    "nees_n_eff",
)


def run_metrics(
    run: Run, hindsight: PoseTrack | None, asked: CheckContext, limits: Limits
) -> dict[str, float | None]:
    """Numbers of one run, nothing aligned; None for what cannot be said.

    `hindsight_rmse_m`, `hindsight_max_m`, `hindsight_max_rad`: distance to where the robot really
    was; `lost_share`: of the rows beyond the limits of lost; `nees_mean` (x y yaw, 3 is expected)
    and `nees_n_eff`: of the run's updates against the best reference, as the checks have them.

    Args:
        run: of an estimator.
        hindsight: where the robot really was.
        asked: the run as the checks are given it.
        limits: from where on it is lost.
    """
    metrics: dict[str, float | None] = dict.fromkeys(_NAMES)
    if run.estimate is None:
        return metrics
    track = run.estimate.track
    if hindsight is not None:
        error = nees(track, hindsight).error
        error = error[np.isfinite(error).all(axis=1)]
        if len(error):
            distance, turn = np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2])
            off = (distance > limits.position_m) | (turn > limits.yaw_rad)
            metrics["hindsight_rmse_m"] = float(np.sqrt(np.mean(distance**2)))
            metrics["hindsight_max_m"] = float(distance.max())
            metrics["hindsight_max_rad"] = float(turn.max())
            metrics["lost_share"] = float(off.mean())
    updates = nees_of_belief(asked)
    if updates is not None:
        test = updates.summary().test
        if test.n:
            metrics["nees_mean"], metrics["nees_n_eff"] = test.mean, test.n_eff
    return metrics
