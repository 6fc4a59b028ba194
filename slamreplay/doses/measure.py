"""A run in the numbers that limits are put on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from slamreplay.bundle.run import Run
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.consistency.evidence.nees import nees
from slamreplay.consistency.evidence.source import Reference
from slamreplay.doses.carried import carried
from slamreplay.doses.metrics import METRICS
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.replay.metrics import trial_metrics
from slamreplay.report.metrics import asked_of, nees_metrics
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.timeline import BAD, GOOD, held, settled

#: Numbers that are worst where an estimator has not a single pose.
_WORST = ("error_max_m", "error_rmse_m", "error_median_m", "error_final_m", "error_max_deg",
          "error_final_deg", "lost_s")  # fmt: skip
#: The same, where the log has what they are held against.
_OF_THE_PATH = ("ate_aligned_m", "relations_m", "relations_rad")

Measured = Mapping[str, float | None]


def measured(
    run: Run,
    baseline: Run,
    judge: Reference | None,
    bundle: Bundle,
    view: BundleView,
    odometry: PoseTrack | None,
) -> dict[str, float | None]:
    """Every number of `METRICS`; None for what there is not.

    Errors are taken at every moment at which the baseline has a pose, of the run as the robot would
    have had it then, against the judge, nothing aligned. A run that has not one pose is infinitely
    wrong: no belief is the worst.

    Args:
        run: of a trial.
        baseline: the undisturbed run of the same estimator and seed.
        judge: what errors are measured against; None is the baseline.
        bundle: the log.
        view: of it, undisturbed.
        odometry: of the view; it carries a run from row to row.
    """
    numbers: dict[str, float | None] = dict.fromkeys(METRICS)
    if run.estimate is None:
        return numbers
    track = run.estimate.track
    # One baseline may stand for those of all seeds: it is the one of this run's seed, too.
    own = replace(baseline, trial=replace(run.trial, perturbation=None, level=None, unit=""))
    told = trial_metrics(run, [own], bundle)
    if judge is not None:
        told |= nees_metrics(asked_of(run, (judge,), view))
        mean, high = told["nees_mean"], told["nees_high"]
        told["nees_interval_ratio"] = mean / high if mean is not None and high else None
    numbers |= {name: told[name] for name in METRICS if name in told}
    numbers |= _sigmas(track)
    beside = track if baseline.estimate is None else baseline.estimate.track
    moments = beside.t_ns[beside.has_pose]
    if not len(moments):
        return numbers
    belief = carried(track, odometry, moments)
    numbers["unposed_share"] = float(1.0 - belief.has_pose.mean())
    if not belief.has_pose.any():
        alone = trial_metrics(baseline, [], bundle)
        worst = [*_WORST, *(name for name in _OF_THE_PATH if alone[name] is not None)]
        return {**numbers, **dict.fromkeys(worst, math.inf), "lost_share": 1.0}
    return {**numbers, **_errors(belief, beside if judge is None else judge.track)}


def _errors(belief: PoseTrack, truth: PoseTrack) -> dict[str, float | None]:
    """Of the rows with a pose, in time order, where the truth is known."""
    compared = nees(belief, truth)
    known = np.isfinite(compared.error[:, :2]).all(axis=1)
    if not known.any():
        return {}
    error, t_ns = compared.error[known], compared.t_ns[known]
    distance, turn = np.hypot(error[:, 0], error[:, 1]), np.degrees(np.abs(error[:, 2]))
    limits = Limits()
    off = (distance > limits.position_m) | (turn > math.degrees(limits.yaw_rad))
    headed = turn[np.isfinite(turn)]
    return {
        "error_max_m": float(distance.max()),
        "error_rmse_m": float(np.sqrt(np.mean(distance**2))),
        "error_median_m": float(np.median(distance)),
        "error_final_m": float(distance[-1]),
        "error_max_deg": float(headed.max()) if len(headed) else None,
        "error_final_deg": float(headed[-1]) if len(headed) else None,
        "lost_s": _lost_s(t_ns, off, limits),
        "lost_share": float(off.mean()),
    }


def _lost_s(t_ns: np.ndarray, off: np.ndarray, limits: Limits) -> float:
    """Seconds in which a run (N rows) is lost: off for long enough, as the verdict has it."""
    flags = np.where(off, BAD, GOOD).astype(np.int8)
    bridge = ns(limits.bridge_s)
    timeline = held(t_ns, flags, int(t_ns[0]), int(t_ns[-1]), bridge)
    lost = [s for s in settled(timeline, ns(limits.lost_s), bridge) if s.value == BAD]
    return sum(s.duration_ns for s in lost) / NS_PER_S


def _sigmas(track: PoseTrack) -> dict[str, float | None]:
    """Standard deviation along the widest axis of position, median and greatest over the rows."""
    cov: se2.Array = track.cov[:, :2, :2]
    cov = cov[np.isfinite(cov).all(axis=(1, 2))]
    if not len(cov):
        return {}
    widest = np.sqrt(np.maximum(np.linalg.eigvalsh(cov)[:, 1], 0.0))
    return {"sigma_m": float(np.median(widest)), "sigma_max_m": float(widest.max())}
