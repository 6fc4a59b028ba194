"""One log closed in one way: which closures were false, and how far off the way came out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.estimators.pose_graph.slam import Slam, slam_of
from slamreplay.estimators.pose_graph.smoothing import Smoothed, smoothed
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.topics import START_NS

#: A closure that puts the robot farther than this from where it was is false.
FALSE_M, FALSE_RAD = 0.5, np.radians(10.0)
#: The window that Cartographer's constraint builder searches by default, m.
_FIXED_WINDOW_M = 7.0
#: No limit at all, where a limit is a number.
_NONE = 1e12


@dataclass(frozen=True)
class Trial:
    """What became of a log.

    Attributes:
        taken: closures that were taken.
        false: of them those that put the robot elsewhere.
        left_on: of these those that the kernel did not switch off.
        best_false: highest score of a place that was found and is false, taken or not; 0: none.
        median_m: error of the position, over the way.
        largest_m: the largest one.
        end_m: at the end.
        false_from: (F, 2) where the robot was at each false closure,
        false_to: (F, 2) and where it put it.
    """

    taken: int
    false: int
    left_on: int
    best_false: float
    median_m: float
    largest_m: float
    end_m: float
    false_from: se2.Array
    false_to: se2.Array


def config_of(min_score: float, *, is_checked: bool, has_kernel: bool) -> GraphConfig:
    """The pose graph's configuration, or one that goes by the score alone.

    Args:
        min_score: what a place must score.
        is_checked: whether the window comes from the graph's own covariance, and closures must
            agree with it and, where it is not sure, with each other; without, a fixed window is
            searched and the best place is taken, as the textbook has it.
        has_kernel: whether closures that contradict the rest are switched off gradually.
    """
    phi = GraphConfig().phi if has_kernel else _NONE
    if is_checked:
        return GraphConfig(min_score=min_score, phi=phi)
    return GraphConfig(
        min_score=min_score,
        least_window_m=_FIXED_WINDOW_M,
        gate=_NONE,
        sure_m=_NONE,
        rounds=0,  # laying passes onto each other would spread what a false closure did
        phi=phi,
    )


def closed(
    view: BundleView, recording: Recording, min_score: float, *, is_checked: bool
) -> tuple[Trial, Trial]:
    """Close a log's loops, and hold the way without and with the kernel against the truth."""
    bare, held = (
        config_of(min_score, is_checked=is_checked, has_kernel=kernel) for kernel in (False, True)
    )
    slam = slam_of(view, bare, "pose_graph", is_online=False)
    assert slam.smoothed is not None
    start = slam.start
    # The closures are the same: the kernel comes in when all poses are solved.
    again = smoothed(slam.local, slam.maps, slam.closed, start.xyyaw, start.cov, held)
    return _judged(slam, slam.smoothed, recording), _judged(slam, again, recording)


def _judged(slam: Slam, end: Smoothed, recording: Recording) -> Trial:
    true = recording.motion.poses_at((slam.local.t_ns - START_NS) / NS_PER_S)
    poses = slam.local.carried(end.xyyaw)
    first = int(np.argmax(np.isfinite(poses).all(axis=1)))
    poses = se2.compose(true[first], se2.between(poses[first], poses))
    off = np.hypot(*(poses - true)[first:, :2].T)
    is_false, there = _false(slam, true)
    taken = np.array([c.accepted for c in slam.closed.candidates], dtype=bool)
    scores = np.array([c.score for c in slam.closed.candidates])
    bad = np.flatnonzero(taken & is_false)
    return Trial(
        taken=int(taken.sum()),
        false=len(bad),
        left_on=int((is_false[taken] & (end.switches >= 0.5)).sum()),
        best_false=float(scores[is_false].max(initial=0.0)),
        median_m=float(np.median(off)),
        largest_m=float(off.max()),
        end_m=float(off[-1]),
        false_from=true[_rows(slam)[bad, 1], :2],
        false_to=there[bad],
    )


def odometry_end_m(recording: Recording) -> float:
    """How far off odometry alone is at the end."""
    odometry, motion = recording.odometry, recording.motion
    believed = se2.compose(motion.xyyaw[0], odometry.xyyaw[-1])
    return float(np.hypot(*(believed - motion.poses_at(odometry.t_s[-1:])[0])[:2]))


def _rows(slam: Slam) -> np.ndarray:
    """(N, 2) scans at which the submaps of each candidate have their reference, old and new."""
    pairs = np.array([[c.old, c.new] for c in slam.closed.candidates], dtype=np.int64)
    return slam.local.nodes[slam.maps.reference[pairs.reshape(-1, 2)]]


def _false(slam: Slam, true: se2.Array) -> tuple[np.ndarray, se2.Array]:
    """(N,) which candidates are false, and (N, 2) where each puts the robot."""
    rows = _rows(slam)
    measured = np.array([c.xyyaw for c in slam.closed.candidates]).reshape(-1, 3)
    there = se2.compose(true[rows[:, 0]], measured)
    off = there - true[rows[:, 1]]
    turned = np.abs(se2.wrap_angle(off[:, 2]))
    return (np.hypot(off[:, 0], off[:, 1]) > FALSE_M) | (turned > FALSE_RAD), there[:, :2]
