"""The formula of the lag against estimators that are replayed with that very delay.

A scan that is stamped late by d shows the place of d earlier: an estimator that believes scans is
then where the robot was, and its error is the motion of the last d. Odometry on tf that is old by d
does the same to whoever believes the wheels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Run
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns
from slamreplay.labs.latency_budget.ask import Replayed, Stage
from slamreplay.replay.design import design
from slamreplay.replay.metrics import baseline_of
from slamreplay.replay.runner import replay
from slamreplay.verdict.latency.ages import motion_since

#: A row at which less motion is predicted tells nothing of it.
_LEAST_M = 0.005


@dataclass(frozen=True)
class Checked:
    """One estimator with one delay.

    Attributes:
        estimator: name in the registry.
        perturbation: `NAME.VARIANT`.
        delay_s: its level.
        n: rows at which the robot moved.
        predicted_m: median and 95th percentile of the motion within the delay, None without rows.
        replayed_m: the same of the distance from the undisturbed run.
        slope: replayed over predicted, as vectors: 1 is the formula.
        rest_m: root mean square of what the formula leaves.
        reason: why there is nothing, else empty.
    """

    estimator: str
    perturbation: str
    delay_s: float
    n: int = 0
    predicted_m: tuple[float, float] | None = None
    replayed_m: tuple[float, float] | None = None
    slope: float | None = None
    rest_m: float | None = None
    reason: str = ""


def checked(
    bundle: Bundle,
    asked: Sequence[Replayed],
    stages: Sequence[Stage],
    seed: int,
    progress: Callable[[str, float], None] | None = None,
    cache: Path | None = None,
) -> tuple[Checked, ...]:
    """Each pair at the length of each stage, beside its undisturbed run."""
    pairs = [(ask, stage.stage_s) for ask in asked for stage in stages]
    trials = [
        trial
        for ask, delay_s in pairs
        for trial in design(bundle, [ask.estimator], [f"{ask.perturbation}={delay_s!r}"], seed)
    ]
    runs = replay(bundle, list(dict.fromkeys(trials)), progress=progress, cache=cache)
    track = odometry_track(bundle.view())
    found = []
    for ask, delay_s in pairs:
        run = next(r for r in runs if (r.trial.estimator, r.trial.perturbation, r.trial.level)
                   == (ask.estimator, ask.perturbation, delay_s))  # fmt: skip
        found.append(_against(run, baseline_of(run, runs), track, ask, delay_s))
    return tuple(found)


def _against(
    run: Run, plain: Run | None, track: PoseTrack | None, ask: Replayed, delay_s: float
) -> Checked:
    none = Checked(ask.estimator, ask.perturbation, delay_s)
    if run.estimate is None or plain is None or plain.estimate is None or track is None:
        return Checked(ask.estimator, ask.perturbation, delay_s,
                       reason=run.not_applicable or "there is no odometry")  # fmt: skip
    late = run.estimate.track
    beside = plain.estimate.track.at(late.t_ns).xyyaw
    motion = motion_since(track, late.t_ns - ns(delay_s), late.t_ns)
    predicted = (se2.compose(beside, se2.inverse(motion)) - beside)[:, :2]
    seen = (late.xyyaw - beside)[:, :2]
    rows = np.isfinite(predicted).all(axis=1) & np.isfinite(seen).all(axis=1)
    rows &= np.hypot(*np.nan_to_num(predicted).T) >= _LEAST_M
    if not rows.any():
        return none
    predicted, seen = predicted[rows], seen[rows]
    return Checked(
        ask.estimator,
        ask.perturbation,
        delay_s,
        int(rows.sum()),
        _percentiles(predicted),
        _percentiles(seen),
        float(np.sum(predicted * seen) / np.sum(predicted**2)),
        float(np.sqrt(np.mean(np.sum((seen - predicted) ** 2, axis=1)))),
    )


def _percentiles(xy: se2.Array) -> tuple[float, float]:
    p50, p95 = np.percentile(np.hypot(*xy.T), [50.0, 95.0]).tolist()
    return p50, p95
