"""The localizer that was recorded, as one estimator beside those that are run again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.belief import By, belief_times, recorded_belief, spoken_ns
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.inputs import need_odometry
from slamreplay.geometry import se2

#: Words that differ by more than this, in more than this share of the rows, are two beliefs.
_APART_M, _APART_RAD, _SHARE = 0.05, np.radians(2.0), 0.05
_AXES = ("x m", "y m", "yaw rad")


@dataclass(frozen=True)
class Recorded:
    """What the robot's own localizer believed at each scan, as a planner read it.

    map->odom before the topic of poses, each from when it arrived; the covariance is the latest
    published one, NaN before the first. Nothing is estimated: it cannot be run again, so that no
    perturbation applies to it but that of the covariance it gave out.
    """

    name: ClassVar[str] = "recorded"
    needs: ClassVar[frozenset[str]] = frozenset({"localizer"})
    settings: ClassVar[frozenset[str]] = frozenset()
    reruns: ClassVar[bool] = False
    without_noise: ClassVar[str] = "it was recorded: nothing can be told to it any more"
    by: ClassVar[By | None] = None

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """One row per scan (per odometry sample without scans), NaN before the first word.

        Diagnostics: `updated` (1 where the localizer spoke since the row before). The ledger has a
        row for each word that was not the one before; what it had measured nobody recorded, so
        that residual and S are NaN, and `moved` is NaN where odometry does not tell it apart from
        driving.

        Raises:
            NotApplicableError: no localizer spoke, or there is no odometry to compose tf with.
        """
        if "odometry" in self.needs:
            need_odometry(view, self.name)
        scans = scan_set(view)
        t_ns = belief_times(view) if scans is None or not len(scans) else scans.t_ns
        track = recorded_belief(view, t_ns, by=self.by)
        if track is None or not track.has_pose.any():
            raise NotApplicableError("no localizer spoke in this log", where=self.name)
        ledger = recorded_ledger(view, self.by)
        return Estimate(track, (ledger,), {"updated": _updated(t_ns, ledger.t_ns)})


@dataclass(frozen=True)
class RecordedPose(Recorded):
    """What the localizer's topic of poses alone says, carried by odometry."""

    name: ClassVar[str] = "recorded_pose"
    by: ClassVar[By | None] = "pose"


@dataclass(frozen=True)
class RecordedTf(Recorded):
    """What map->odom alone says, composed with odometry."""

    name: ClassVar[str] = "recorded_tf"
    needs: ClassVar[frozenset[str]] = frozenset({"localizer", "odometry"})
    by: ClassVar[By | None] = "tf"


def recorded_names(view: BundleView) -> tuple[str, ...]:
    """The recorded estimators of a log: none, one, or two where tf and poses are two beliefs."""
    t_ns = belief_times(view)
    tf, pose = (recorded_belief(view, t_ns, by=by) for by in _BOTH)
    if tf is None or pose is None:
        either = pose if tf is None else tf
        return () if either is None or not either.has_pose.any() else (Recorded.name,)
    apart = tf.xyyaw - pose.xyyaw
    both = np.isfinite(apart).all(axis=1)
    if not both.any():
        return (Recorded.name,) if tf.has_pose.any() or pose.has_pose.any() else ()
    far = np.hypot(apart[both, 0], apart[both, 1]) > _APART_M
    far |= np.abs(se2.wrap_angle(apart[both, 2])) > _APART_RAD
    same = float(far.mean()) <= _SHARE
    return (Recorded.name,) if same else (RecordedTf.name, RecordedPose.name)


def recorded_ledger(view: BundleView, by: By | None = None) -> Innovations:
    """How far each word of the localizer moved the belief: published after, carried before.

    Args:
        view: the log.
        by: of tf or of the poses alone; by default as a planner reads it.
    """
    if by is None:
        by = "tf" if len(spoken_ns(view, "tf")) else "pose"
    t_ns = spoken_ns(view, by)
    n = len(t_ns)
    moved = np.full((n, 3), np.nan)
    # One ns before a word arrived the one before it still held; nobody drives far in that time.
    before, after = (recorded_belief(view, at, by=by) for at in (t_ns - 1, t_ns))
    if before is not None and after is not None:
        moved = np.where(_is_carried(view, t_ns)[:, None], after.xyyaw - before.xyyaw, np.nan)
        moved[:, 2] = se2.wrap_angle(moved[:, 2])
    frame = view.manifest.frames.map or "map"
    return Innovations(
        f"recorded {by}",
        t_ns,
        np.full((n, 3), np.nan),
        np.full((n, 3, 3), np.nan),
        np.ones(n, dtype=bool),
        _AXES,
        frame,
        moved,
        is_predicted=False,
    )


def _is_carried(view: BundleView, t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(K,) whether odometry tells how far the robot drove from one time to the next."""
    odometry = odometry_track(view)
    if odometry is None:
        return np.zeros(len(t_ns), dtype=bool)
    known = odometry.at(t_ns).has_pose
    return np.asarray(known & np.append(True, known[:-1])) if len(t_ns) else known


def _updated(t_ns: NDArray[np.int64], spoken: NDArray[np.int64]) -> se2.Array:
    """(N,) 1 where something was spoken since the row before."""
    heard = np.maximum.accumulate(np.searchsorted(spoken, t_ns, side="right"))
    return (np.diff(heard, prepend=0) > 0).astype(np.float64)


_BOTH: tuple[By, By] = ("tf", "pose")
