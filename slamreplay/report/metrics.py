"""What a run was worth against hindsight, and whether its covariance was honest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.run import Run
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.consistency.belief.credibility import nees_of_belief
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.nees import nees
from slamreplay.consistency.evidence.references import references_of
from slamreplay.consistency.evidence.source import Reference
from slamreplay.replay.metrics import trial_metrics
from slamreplay.replay.reported import as_published
from slamreplay.verdict.limits import Limits

#: Estimators that are the robot's own belief as it was published.
PUBLISHED = ("recorded", "recorded_pose")

_NAMES = (
    "hindsight_rmse_m",
    "hindsight_max_m",
    "hindsight_max_rad",
    "lost_share",
)
_NEES_NAMES = ("nees_mean", "nees_low", "nees_high", "nees_dof", "nees_n_eff")


def asked_of(run: Run, references: tuple[Reference, ...], view: BundleView) -> CheckContext:
    """A run as the checks are given it: the recorded localizer at the updates it published."""
    if run.estimate is not None and run.trial.estimator in PUBLISHED:
        return CheckContext(run.estimate.track, references, as_published(view, run.trial))
    return CheckContext.of_run(run, references, view)


def run_metrics(
    run: Run, hindsight: PoseTrack | None, asked: CheckContext, limits: Limits
) -> dict[str, float | None]:
    """Numbers of one run, nothing aligned; None for what cannot be said.

    `hindsight_rmse_m`, `hindsight_max_m`, `hindsight_max_rad`: distance to where the robot really
    was; `lost_share`: of the rows beyond the limits of lost; `nees_mean` of the run's updates
    against the best reference, as the checks have them, `nees_dof` of which are expected,
    `nees_low` to `nees_high` in 95 of 100 logs of consistent ones with so many independent updates
    (`nees_n_eff`).

    Args:
        run: of an estimator.
        hindsight: where the robot really was.
        asked: the run as the checks are given it.
        limits: from where on it is lost.
    """
    metrics: dict[str, float | None] = dict.fromkeys((*_NAMES, *_NEES_NAMES))
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
    return {**metrics, **nees_metrics(asked)}


def metrics_of_runs(bundle: Bundle, runs: Sequence[Run]) -> list[dict[str, float | None]]:
    """Numbers of runs laid beside each other, without looking back on the log.

    Each against the undisturbed run of its estimator and the log's own references: those of
    `trial_metrics` and `nees_metrics`.
    """
    view, references = bundle.view(), references_of(bundle, None)
    return [
        {
            **trial_metrics(run, runs, bundle),
            **nees_metrics(asked_of(run, references, view)),
        }
        for run in runs
    ]


def nees_metrics(asked: CheckContext) -> dict[str, float | None]:
    """The part of `run_metrics` that is about the covariance."""
    metrics: dict[str, float | None] = dict.fromkeys(_NEES_NAMES)
    updates = nees_of_belief(asked)
    if updates is not None:
        test = updates.summary().test
        if test.n:
            metrics["nees_mean"], metrics["nees_n_eff"] = test.mean, test.n_eff
            metrics["nees_low"], metrics["nees_high"] = test.low, test.high
            metrics["nees_dof"] = float(test.dof)
    return metrics
