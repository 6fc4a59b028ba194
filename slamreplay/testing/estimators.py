"""check_estimator: the assertions every estimator must meet.

from slamreplay.testing.estimators import check_estimator
check_estimator(MyEstimator())
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from slamreplay.bundle.run import Estimate, Innovations, Run, Trial, run_bytes
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.errors import SlamreplayError
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.replay.metrics import judging_reference
from slamreplay.testing import edits
from slamreplay.testing.conformance import demand, demand_frozen_dataclass, untouched_global_rng
from slamreplay.testing.ledgers import check_ledger, ledger_before
from slamreplay.testing.synthetic import synthetic_bundle

PARTS = ("odometry", "scans", "map", "sightings", "localizer")
#: What settings are changed to: the baseline of no offset (0), switch (0) or ratio (1).
CHANGED = 2.0
#: How the world is moved: nothing in it is round, straight or central.
ELSEWHERE = np.array([31.7, -12.3, 2.2])


def check_estimator(
    estimator: Any,
    *,
    bundle: Bundle | None = None,
    seed: int = 1,
    tolerance_m: float = 1e-6,
    tolerance_rad: float = 1e-6,
    tolerance_nees: float | None = None,
) -> None:
    """Raise ConformanceError at the first part of the contract that the estimator breaks.

    Args:
        estimator: with `name`, `needs`, `settings` and `run(view, *, seed)`; one that looks ahead
            says so with `causal = False`.
        bundle: evidence with scans, odometry on tf, a map, an initial pose, sightings of surveyed
            tags and references, of at least 6 s; by default a robot in a small synthetic room.
        seed: for every run.
        tolerance_m: by how much (median over rows) poses may fail to follow the map frame when it
            is moved. For sampling methods: their noise.
        tolerance_rad: the same for headings.
        tolerance_nees: by which factor (median over rows) NEES against the reference may change
            meanwhile; by default 1.001, and 3 where positions may miss by a centimetre and more.
    """
    bundle = synthetic_bundle(seconds=8.0, with_tags=True) if bundle is None else bundle
    demand_frozen_dataclass(estimator)
    for attribute in ("needs", "settings"):
        demand(
            isinstance(getattr(estimator, attribute, None), frozenset),
            f"{estimator.name} has no {attribute}: frozenset[str]",
        )
    demand(estimator.needs <= set(PARTS), f"{estimator.name} needs parts nobody knows of")

    def run(evidence: Bundle | BundleView) -> Estimate:
        view = evidence if isinstance(evidence, BundleView) else evidence.view()
        with untouched_global_rng(estimator.name):
            estimate = estimator.run(view, seed=seed)
        demand(isinstance(estimate, Estimate), f"{estimator.name} gives no Estimate")
        return estimate

    before = edits.fingerprints(bundle)
    baseline = run(bundle)
    demand(edits.fingerprints(bundle) == before, f"{estimator.name} writes into the evidence")
    _same_seed_gives_same_bits(estimator, baseline, run(bundle))
    _rows_follow_the_scans(estimator, bundle, baseline)
    _covariances_are_covariances(estimator, baseline)
    check_ledger(estimator.name, baseline, bundle)
    demand(baseline.innovations, f"{estimator.name} keeps no ledger of what moved its belief")
    _references_are_not_read(estimator, baseline, run(edits.poisoned(bundle)))
    if getattr(estimator, "causal", True):
        _the_past_ignores_the_future(estimator, bundle, baseline, run)
    if tolerance_nees is None:
        tolerance_nees = 1.001 if tolerance_m < 0.01 else 3.0
    _estimates_move_with_the_world(
        estimator, bundle, baseline, run, (tolerance_m, tolerance_rad, tolerance_nees)
    )
    _settings_are_honoured(estimator, bundle, baseline, run)
    _needs_are_honest(estimator, bundle, run)
    _damage_is_marked(estimator, bundle, run)


_Runner = Callable[[Bundle | BundleView], Estimate]


def estimate_bytes(estimate: Estimate) -> bytes:
    """Everything an estimate says, bit by bit."""
    return run_bytes(Run(Trial("", "", 0), estimate))


def _same_seed_gives_same_bits(estimator: Any, one: Estimate, two: Estimate) -> None:
    demand(
        estimate_bytes(one) == estimate_bytes(two),
        f"{estimator.name}: the same seed gives other bits the second time",
    )


def _rows_follow_the_scans(estimator: Any, bundle: Bundle, baseline: Estimate) -> None:
    scans = scan_set(bundle.view())
    demand(
        scans is None or np.array_equal(baseline.track.t_ns, scans.t_ns),
        f"{estimator.name} does not give one row per scan in processing order",
    )
    for name, column in baseline.diagnostics.items():
        demand(
            np.shape(column) == (len(baseline.track),),
            f"{estimator.name}: diagnostic '{name}' has not one number per row",
        )
    demand(baseline.track.has_pose.any(), f"{estimator.name} gives no pose at all")


def _covariances_are_covariances(estimator: Any, estimate: Estimate) -> None:
    track = estimate.track
    partly = np.isfinite(track.xyyaw).any(axis=1) & ~track.has_pose
    demand(not partly.any(), f"{estimator.name} gives a pose that is partly NaN")
    cov = track.cov[track.has_pose]
    demand(np.isfinite(cov).all(), f"{estimator.name} gives a pose without a finite covariance")
    scale = np.maximum(np.abs(cov).max(axis=(1, 2), initial=0.0), 1e-300)
    skew = np.abs(cov - np.swapaxes(cov, 1, 2)).max(axis=(1, 2), initial=0.0)
    demand((skew <= 1e-9 * scale).all(), f"{estimator.name}: a covariance is not symmetric")
    least = np.linalg.eigvalsh(cov).min(axis=1, initial=np.inf) if len(cov) else np.zeros(0)
    demand(
        (least >= -1e-9 * scale).all(), f"{estimator.name}: a covariance is not positive definite"
    )


def _references_are_not_read(estimator: Any, baseline: Estimate, other: Estimate) -> None:
    demand(
        estimate_bytes(baseline) == estimate_bytes(other),
        f"{estimator.name} reads references that only judge",
    )


def _the_past_ignores_the_future(
    estimator: Any, bundle: Bundle, baseline: Estimate, run: _Runner
) -> None:
    t_ns = baseline.track.t_ns
    middle = int(t_ns[0] + (t_ns[-1] - t_ns[0]) * 5 // 8)
    cut = run(edits.cut(bundle, middle))
    early = cut.track
    past = t_ns < middle - NS_PER_S
    count = int(past.sum())
    same = (
        early.xyyaw[:count].tobytes() == baseline.track.xyyaw[past].tobytes()
        and early.cov[:count].tobytes() == baseline.track.cov[past].tobytes()
    )
    demand(same, f"{estimator.name} is not causal: cutting the future changes the past")
    # What is not there before the cut differs in number only where it is of the future.
    whole, part = (ledger_before(e, middle - NS_PER_S) for e in (baseline, cut))
    demand(whole == part, f"{estimator.name}: cutting the future changes the ledger of the past")


def _estimates_move_with_the_world(
    estimator: Any,
    bundle: Bundle,
    baseline: Estimate,
    run: _Runner,
    tolerances: tuple[float, float, float],
) -> None:
    if baseline.track.frame_id != bundle.manifest.frames.map:
        return
    elsewhere = edits.moved(bundle, ELSEWHERE)
    there = run(elsewhere).track
    off = se2.between(se2.compose(ELSEWHERE, baseline.track.xyyaw), there.xyyaw)
    both = np.isfinite(off).all(axis=1)
    demand(both.any(), f"{estimator.name} loses its poses when the map frame lies elsewhere")
    distance = float(np.median(np.hypot(off[both, 0], off[both, 1])))
    turn = float(np.median(np.abs(off[both, 2])))
    demand(
        distance <= tolerances[0] and turn <= tolerances[1],
        f"{estimator.name} does not follow a moved map frame: {distance:g} m, {turn:g} rad off",
    )
    here, moved = (_nees(t, b) for t, b in ((baseline.track, bundle), (there, elsewhere)))
    told = (here > 0.0) & (moved > 0.0)
    if told.any():
        factor = float(np.exp(np.median(np.abs(np.log(moved[told] / here[told])))))
        demand(
            factor <= tolerances[2],
            f"{estimator.name}: NEES changes by a factor of {factor:.3g} where the map frame lies "
            "elsewhere: its covariance does not turn with it",
        )


def _nees(track: PoseTrack, bundle: Bundle) -> se2.Array:
    """(N,) against the reference that judges, NaN where that or a covariance is missing."""
    truth = judging_reference(bundle)
    if truth is None:
        return np.full(len(track), np.nan)
    error = track.xyyaw - truth.at(track.t_ns).xyyaw
    error[:, 2] = se2.wrap_angle(error[:, 2])
    return Innovations("", track.t_ns, error, track.cov, np.ones(len(track), dtype=bool)).nis


def _settings_are_honoured(
    estimator: Any, bundle: Bundle, baseline: Estimate, run: _Runner
) -> None:
    for name in sorted(estimator.settings):
        changed = run(bundle.view().with_setting(name, CHANGED))
        demand(
            estimate_bytes(changed) != estimate_bytes(baseline),
            f"{estimator.name} declares the setting '{name}' and does not honour it",
        )


def _needs_are_honest(estimator: Any, bundle: Bundle, run: _Runner) -> None:
    for part in PARTS:
        evidence = edits.without(bundle, part)
        try:
            run(evidence)
        except SlamreplayError as error:
            demand(part in estimator.needs, f"{estimator.name} needs '{part}' undeclared: {error}")
        else:
            demand(
                part not in estimator.needs,
                f"{estimator.name} says it needs '{part}' and runs without a word when it is gone",
            )


def _damage_is_marked(estimator: Any, bundle: Bundle, run: _Runner) -> None:
    """A gap in odometry longer than a second, and rows that come twice."""
    t_ns = bundle.table("scans").t_ns
    start, end = int(np.quantile(t_ns, 0.4)), int(np.quantile(t_ns, 0.7))
    damaged = {
        "a gap": edits.with_gap(bundle, start, end),
        "repeated stamps": edits.with_repeated_stamps(bundle),
    }
    for what, evidence in damaged.items():
        try:
            estimate = run(evidence)
        except SlamreplayError:
            continue  # said so: that is allowed
        _covariances_are_covariances(estimator, estimate)
        _rows_follow_the_scans(estimator, evidence, estimate)
        check_ledger(estimator.name, estimate, evidence)
        demand(
            estimate.track.has_pose[-1],
            f"{estimator.name} has no pose any more after {what}",
        )
