"""What an estimator believed of one log, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.estimators import ESTIMATORS
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.topics import START_NS

#: In this order they are told and drawn, with whether they are in the robot's map from the start.
ESTIMATED = {"dead_reckoning": False, "amcl": True, "pose_graph_online": False}
CLOSURES = "loop closure"
#: Belief and truth are apart by no more than this many standard deviations if the claim is honest.
SIGMAS = 3.0


@dataclass(frozen=True, eq=False)
class Course:
    """Error and claim over time, and what closed loops.

    Attributes:
        t_s: (N,) since the start of the log.
        error_m: (N,) of the position.
        sigma_m: (N,) standard deviation of the position along its widest axis.
        closures_s: when closures were taken.
    """

    t_s: se2.Array
    error_m: se2.Array
    sigma_m: se2.Array
    closures_s: tuple[float, ...]

    def sigma_at(self, t_s: float) -> float:
        """The claim that held at a time."""
        return float(self.sigma_m[self._row(t_s)])

    def error_at(self, t_s: float) -> float:
        """The error at a time."""
        return float(self.error_m[self._row(t_s)])

    def widest(self, from_s: float) -> tuple[float, float]:
        """The largest claim from a time on, and when."""
        rows = np.flatnonzero(self.t_s >= from_s)
        k = rows[np.argmax(self.sigma_m[rows])]
        return float(self.sigma_m[k]), float(self.t_s[k])

    def honest_share(self, from_s: float) -> float:
        """Share of the moments from a time on at which the error is within three sigma."""
        rows = self.t_s >= from_s
        return float(np.mean(self.error_m[rows] <= SIGMAS * self.sigma_m[rows]))

    def _row(self, t_s: float) -> int:
        return max(int(np.searchsorted(self.t_s, t_s, side="right")) - 1, 0)


def slip_of(recording: Recording) -> tuple[float, float]:
    """When the wheels began and ceased to say more than the robot moved."""
    motion = recording.motion
    rows = np.flatnonzero(np.abs(motion.wheels[:, 0] - motion.twist[:, 0]) > 1e-3)
    return float(motion.t_s[rows[0]]), float(motion.t_s[rows[-1]])


def without_map(view: BundleView) -> BundleView:
    """The log without what its localizer was told and said: no start is known in the map."""
    transforms = view.table("transforms")
    own = transforms.take(transforms["parent_frame"] != "map")
    for name in ("initial_poses", "poses"):
        view = view.with_table(Table.empty(TABLES[name]))
    return view.with_table(own)


def course_of(name: str, view: BundleView, recording: Recording, seed: int) -> Course:
    """Run an estimator over a log and hold it against the truth."""
    given = view if ESTIMATED[name] else without_map(view)
    estimate = ESTIMATORS.load(name)().run(given, seed=seed)
    track = estimate.track.take(estimate.track.has_pose)
    t_s = (track.t_ns - START_NS) / NS_PER_S
    true = recording.motion.poses_at(t_s)
    believed = track.xyyaw
    if not ESTIMATED[name]:  # in a frame of its own, which is where it began
        believed = se2.compose(true[0], se2.between(believed[0], believed))
    off = believed - true
    # A closure that waited for others moved nothing yet when it was found.
    taken = [
        i.t_ns[i.accepted & np.isfinite(i.moved).all(axis=1)]
        for i in estimate.innovations
        if i.source == CLOSURES
    ]
    times = np.unique(np.concatenate(taken)) if taken else np.empty(0, dtype=np.int64)
    return Course(
        t_s,
        np.hypot(off[:, 0], off[:, 1]),
        np.sqrt(np.linalg.eigvalsh(track.cov[:, :2, :2])[:, -1]),
        tuple(((times - START_NS) / NS_PER_S).tolist()),
    )
