"""One localizer on one log: what it believed, what of it was right, and what it was let do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.estimator import Amcl
from slamreplay.estimators.start import GLOBAL
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.labs.two_run.rules import Rules
from slamreplay.simulate.alike import BAY_LENGTH_M
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.topics import START_NS
from slamreplay.verdict.actions import actions
from slamreplay.verdict.limits import Limits


@dataclass(frozen=True)
class Motion:
    """A motion that the robot began, and whether the gate would have let it.

    Attributes:
        t_s: when, since the start.
        sigma_m: standard deviation of the position towards the nearest obstacle on its way.
        clearance_m: from the robot's edge to that obstacle.
        error_m: how far the belief was from the truth then.
        allowed: whether three sigma fit into the clearance.
    """

    t_s: float
    sigma_m: float
    clearance_m: float
    error_m: float
    allowed: bool

    @property
    def deceived(self) -> bool:
        """Let run although the error was larger than the room."""
        return self.allowed and self.error_m > self.clearance_m


@dataclass(frozen=True, eq=False)
class Course:
    """What a localizer believed over one log; rows are scans.

    Attributes:
        t_s: (N,) since the start.
        xyyaw: (N, 3) as believed.
        true_xyyaw: (N, 3) where the robot was.
        sigma_m: (N,) standard deviation of the position along its widest axis.
        tight: (N,) sigma within the rule, and one cluster.
        right: (N,) error within the rule.
        motions: begun motions in time order.
        credible_s: from when on it was credible; None: never in this log.
        out_s: when the robot left the bay.
    """

    t_s: se2.Array
    xyyaw: se2.Array
    true_xyyaw: se2.Array
    sigma_m: se2.Array
    tight: NDArray[np.bool_]
    right: NDArray[np.bool_]
    motions: tuple[Motion, ...]
    credible_s: float | None
    out_s: float

    @property
    def wrong_s(self) -> float:
        """Seconds for which the belief was wrong."""
        return self._seconds(~self.right)

    @property
    def wrong_until_s(self) -> float:
        """When it was wrong for the last time; 0 where it never was."""
        return float(self.t_s[~self.right][-1]) if not self.right.all() else 0.0

    @property
    def collapsed_s(self) -> float:
        """Seconds for which it was tight and wrong."""
        return self._seconds(self.tight & ~self.right)

    @property
    def waiting(self) -> tuple[Motion, ...]:
        """Motions that were begun before the belief was credible."""
        until = np.inf if self.credible_s is None else self.credible_s
        return tuple(m for m in self.motions if m.t_s < until)

    def _seconds(self, holds: NDArray[np.bool_]) -> float:
        return float(np.diff(self.t_s)[holds[:-1]].sum())


def localise(
    view: BundleView,
    recording: Recording,
    config: AmclConfig,
    *,
    anywhere: bool,
    rules: Rules,
    seed: int,
) -> Course:
    """Run AMCL over a log, from the pose that was clicked or from anywhere in the map."""
    given = view.with_setting(GLOBAL, 1.0) if anywhere else view
    estimate = Amcl(config, judge_scans=False).run(given, seed=seed)
    known = np.flatnonzero(estimate.track.has_pose)
    track = estimate.track.take(known)
    t_s = (track.t_ns - START_NS) / NS_PER_S
    true = recording.motion.poses_at(t_s)
    off = np.hypot(*(track.xyyaw - true)[:, :2].T)
    turned = np.abs(se2.wrap_angle(track.xyyaw[:, 2] - true[:, 2]))
    sigma = np.sqrt(np.linalg.eigvalsh(track.cov[:, :2, :2])[:, -1])
    clusters = estimate.diagnostics["clusters"][known]
    tight = (sigma <= rules.tight_to_sigma_m) & (clusters == 1.0)
    right = (off <= rules.right_to_m) & (turned <= np.radians(rules.right_to_deg))
    motions = []
    for action in actions(given, track, Limits()):
        at_s = (action.t_ns - START_NS) / NS_PER_S
        if action.allowed is None or action.sigma_m is None or action.clearance_m is None:
            continue
        error = float(off[max(int(np.searchsorted(t_s, at_s, side="right")) - 1, 0)])
        motions.append(Motion(at_s, action.sigma_m, action.clearance_m, error, action.allowed))
    return Course(
        t_s, track.xyyaw, true, sigma, tight, right, tuple(motions),
        _held_from(t_s, tight & right, rules.credible_for_s),
        float(t_s[np.argmax(true[:, 0] > BAY_LENGTH_M)]),
    )  # fmt: skip


def _held_from(t_s: se2.Array, holds: NDArray[np.bool_], for_s: float) -> float | None:
    """When something first began to hold for that long."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        if t_s[last - 1] - t_s[first] >= for_s:
            return float(t_s[first])
    return None
