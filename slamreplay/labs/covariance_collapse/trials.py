"""One estimator told too little noise: error and claim, who finds it, what the gate says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.estimators import ESTIMATORS
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.labs.covariance_collapse.drive import seen_every
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.topics import START_NS
from slamreplay.verdict.actions import actions
from slamreplay.verdict.limits import Limits

#: The checks that are asked: mean NEES, collapse, and the size of innovations.
CHECKS = {"SR-CON-001": "nees", "SR-CON-010": "collapse", "SR-CON-006": "nis"}
_RAISED = ("warning", "error")


@dataclass(frozen=True, eq=False)
class Claim:
    """One run on one log.

    Attributes:
        t_s: (N,) since the start of the log.
        error_m: (N,) of the position, by the truth.
        sigma_m: (N,) standard deviation of the position along its widest axis.
        found_s: by check and seconds between references (None: without), from when on the stretch
            is that it was found in; absent where nothing was found.
        motions: that the gate could be asked about,
        allowed: that it let pass, and
        deceived: of these the ones whose error was larger than the room.
    """

    t_s: se2.Array
    error_m: se2.Array
    sigma_m: se2.Array
    found_s: Mapping[tuple[str, float | None], float]
    motions: int
    allowed: int
    deceived: int

    @property
    def largest_sigmas(self) -> float:
        """The largest error in the claim of its own moment."""
        return float(np.max(self.error_m / np.maximum(self.sigma_m, 1e-9)))


def claim_of(
    name: str,
    scale: float,
    bundle: Bundle,
    recording: Recording,
    every_s: Sequence[float | None],
    seed: int,
) -> Claim:
    """Run an estimator without any code, told so much of its process noise, and ask the checks.

    Args:
        name: of the estimator.
        scale: factor of Q.
        bundle: the log; codes in it only judge.
        recording: for the truth.
        every_s: seconds between references, None for a log without.
        seed: of the run.
    """
    blind = seen_every(bundle, None).view()
    estimate = ESTIMATORS.load(name)().run(
        blind if scale == 1.0 else blind.with_setting("process_noise_scale", scale), seed=seed
    )
    run = Run(Trial(bundle.manifest.bundle_id, name, seed), estimate)
    found: dict[tuple[str, float | None], float] = {}
    for every in every_s:
        view = seen_every(bundle, every).view()
        for finding in ask([CheckContext.of_run(run, (), view)], CHECKS.values()):
            if finding.severity in _RAISED and _too_small(finding):
                at = (finding.id, every)
                start = finding.start_ns or bundle.manifest.start_ns
                found[at] = min(found.get(at, np.inf), (start - START_NS) / NS_PER_S)
    track = estimate.track.take(estimate.track.has_pose)
    t_s = (track.t_ns - START_NS) / NS_PER_S
    error = np.hypot(*(track.xyyaw - recording.motion.poses_at(t_s))[:, :2].T)
    sigma = np.sqrt(np.linalg.eigvalsh(track.cov[:, :2, :2])[:, -1])
    asked = [a for a in actions(blind, track, Limits()) if a.allowed is not None]
    row = np.searchsorted(track.t_ns, [a.t_ns for a in asked], side="right") - 1
    deceived = [
        bool(a.allowed and a.clearance_m is not None and error[max(k, 0)] > a.clearance_m)
        for a, k in zip(asked, row.tolist(), strict=True)
    ]
    return Claim(
        t_s, error, sigma, found, len(asked), sum(bool(a.allowed) for a in asked), sum(deceived)
    )


def _too_small(finding: Finding) -> bool:
    """Whether it says that a covariance is too small: one too large is found by the same checks."""
    if finding.value is None or finding.high is None:
        return True
    return finding.value > finding.high
