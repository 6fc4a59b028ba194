"""Local SLAM over a whole log: every scan laid onto a map of the nodes before it."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.odometry import odometry_tables, odometry_track
from slamreplay.bundle.scans import ScanSet, scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.estimators.scan_matching.config import MatchConfig
from slamreplay.estimators.scan_matching.fit import Fit
from slamreplay.estimators.scan_matching.follower import LEAST_POINTS, Follower
from slamreplay.estimators.scan_matching.told import told_motion
from slamreplay.estimators.scan_matching.trajectory import LocalTrajectory
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.matching.scan_lines import scan_lines

__all__ = ["LocalTrajectory", "MatchConfig", "local_trajectory", "local_trajectory_of"]

#: Covariance of a motion that nothing tells.
UNKNOWN = np.diag([1.0, 1.0, 1.0])


def local_trajectory_of(view: BundleView, config: MatchConfig | None = None) -> LocalTrajectory:
    """Match every scan of a view that has scans, as below.

    It is worked out once for all views that have scans and odometry as recorded: where only the
    start or a setting is perturbed, every estimator that matches scans goes on from the same.
    """
    config = config or MatchConfig()

    def matched(alone: BundleView) -> LocalTrajectory:
        scans = scan_set(alone)
        assert scans is not None
        return local_trajectory(scans, odometry_track(alone), config)

    tables = ["scans", *odometry_tables(view)]
    return view.shared("local trajectory", tables, matched, by=config)


def local_trajectory(
    scans: ScanSet, odometry: PoseTrack | None, config: MatchConfig | None = None
) -> LocalTrajectory:
    """Match every scan against a map of the nodes before it.

    Args:
        scans: of one laser.
        odometry: the first guess; None expects the speed of before.
        config: hyper-parameters.
    """
    config = config or MatchConfig()
    told, laid = told_motion(scans, odometry), _Sweeps(scans)
    found, follower = _Found(len(scans)), Follower(config)
    for k in range(len(scans)):
        during = follower.in_sweep(told.during[k], laid.parts[k], is_told=odometry is not None)
        points, normals = laid.out(k, during)
        if not found.nodes:
            found.fits.append(None)
            if len(points) >= LEAST_POINTS:
                follower.begin(points, normals)
                found.add_node(k, follower.pose, points, normals)
            continue
        step, is_bridged = told.steps[k], bool(told.is_bridged[k])
        fit = follower.follow(step, points, normals, is_bridged=is_bridged)
        found.fits.append(fit)
        found.xyyaw[k], found.cov[k] = follower.pose, follower.cov
        last = found.xyyaw[found.nodes[-1]]
        if follower.lost >= config.lost_scans:
            follower.begin(points, normals)
            found.add_node(k, follower.pose, points, normals)
            found.is_break[-1] = True
            found.motion_cov.append(UNKNOWN)
        elif fit.accepted and _moved(follower.pose, last, config):
            drift, own = follower.add_node(points, normals)
            found.add_node(k, follower.pose, points, normals, own)
            found.motion_cov.append(turned(drift, -last[2]))
    return found.trajectory(scans)


class _Sweeps:
    """The scans as lines about the base."""

    def __init__(self, scans: ScanSet) -> None:
        width = scans.ranges_m.shape[1]
        self._scans = scans
        self._points, self._normals = np.empty((width, 2)), np.empty((width, 2))
        self._usable = np.isfinite(scans.angle_min + scans.angle_increment)
        sweep_s = np.nan_to_num(scans.time_increment_s) * max(width - 1, 0)
        gap_s = np.diff(scans.t_ns, prepend=scans.t_ns[:1]) / 1e9
        #: (N,) how long a sweep takes, as a share of the time since the one before.
        self.parts = np.zeros(len(scans))
        timed = (sweep_s > 0.0) & (gap_s > 0.0)
        self.parts[timed] = np.minimum(sweep_s[timed] / gap_s[timed], 1.0)

    def out(self, scan: int, during: se2.Array) -> tuple[se2.Array, se2.Array]:
        """Points and normals (M, 2), until the next are asked for, of a scan that moved (3,)."""
        scans, count = self._scans, 0
        if self._usable[scan]:
            count = scan_lines(
                scans.ranges_m[scan], scans.hits[scan], scans.angle_min[scan],
                scans.angle_increment[scan], scans.xyyaw_base_laser, during, self._points,
                self._normals,
            )  # fmt: skip
        return self._points[:count], self._normals[:count]


class _Found:
    """A trajectory in the making."""

    def __init__(self, count: int) -> None:
        self.xyyaw, self.cov = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
        self.fits: list[Fit | None] = []
        self.nodes: list[int] = []
        self.points: list[se2.Array] = []
        self.normals: list[se2.Array] = []
        self.is_break: list[bool] = []
        self.motion_cov: list[se2.Array] = []

    def add_node(
        self,
        scan: int,
        pose: se2.Array,
        points: se2.Array,
        normals: se2.Array,
        own: se2.Array | None = None,
    ) -> None:
        self.nodes.append(scan)
        self.xyyaw[scan] = pose
        self.cov[scan] = 0.0 if own is None else own
        self.points.append(points.copy())
        self.normals.append(normals.copy())
        self.is_break.append(False)

    def trajectory(self, scans: ScanSet) -> LocalTrajectory:
        rows = np.array(self.nodes, dtype=np.int64)
        score = np.array([np.nan if f is None else f.score for f in self.fits])
        return LocalTrajectory(
            scans.t_ns,
            self.xyyaw,
            score,
            rows,
            tuple(self.points),
            scans.xyyaw_base_laser[:2].copy(),
            np.where(np.isfinite(score[rows]), score[rows], 1.0),
            np.array(self.motion_cov).reshape(-1, 3, 3),
            np.array(self.is_break, dtype=bool),
            tuple(self.normals),
            self.cov,
            tuple(self.fits),
        )


def _moved(pose: se2.Array, node: se2.Array, config: MatchConfig) -> bool:
    dx, dy, turn = pose[0] - node[0], pose[1] - node[1], pose[2] - node[2]
    turn = abs((turn + np.pi) % (2.0 * np.pi) - np.pi)
    return bool(dx * dx + dy * dy > config.node_m**2 or turn > config.node_rad)
