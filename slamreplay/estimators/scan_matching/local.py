"""Local SLAM over a whole log: every scan laid onto a map of the nodes before it."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.scan_matching.config import MatchConfig
from slamreplay.estimators.scan_matching.follower import LEAST_POINTS, Fit, Follower
from slamreplay.estimators.scan_matching.told import told_motion
from slamreplay.estimators.scan_matching.trajectory import LocalTrajectory
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.matching.scan_lines import scan_lines

__all__ = ["LocalTrajectory", "MatchConfig", "local_trajectory"]

#: Covariance of a motion that nothing tells.
UNKNOWN = np.diag([1.0, 1.0, 1.0])


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
    n, width = scans.ranges_m.shape
    told = told_motion(scans, odometry)
    mount = scans.xyyaw_base_laser
    fits: list[Fit | None] = []
    xyyaw, cov = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    nodes: list[int] = []
    clouds: list[se2.Array] = []
    faces: list[se2.Array] = []
    is_break: list[bool] = []
    covs: list[se2.Array] = []
    follower = Follower(config)
    points, normals = np.empty((width, 2)), np.empty((width, 2))
    usable = np.isfinite(scans.angle_min + scans.angle_increment)
    sweeps = np.nan_to_num(scans.time_increment_s) * (width - 1)
    gaps = np.diff(scans.t_ns, prepend=scans.t_ns[:1]) / 1e9
    for k in range(n):
        during = told.during[k]
        if sweeps[k] > 0.0 and gaps[k] > 0.0:
            part = min(sweeps[k] / gaps[k], 1.0)
            during = follower.in_sweep(during, part, is_told=odometry is not None)
        count = 0
        if usable[k]:
            count = scan_lines(
                scans.ranges_m[k], scans.hits[k], scans.angle_min[k], scans.angle_increment[k],
                mount, during, points, normals,
            )  # fmt: skip
        here, there = points[:count], normals[:count]
        if not nodes:
            fits.append(None)
            if count < LEAST_POINTS:
                continue
            is_node, broken, own = True, False, np.zeros((3, 3))
            follower.begin(here, there)
        else:
            fit = follower.follow(told.steps[k], here, there, is_bridged=bool(told.is_bridged[k]))
            fits.append(fit)
            own, broken = follower.cov, follower.lost >= config.lost_scans
            is_node = broken or (fit.accepted and _moved(follower.pose, xyyaw[nodes[-1]], config))
            if broken:
                follower.begin(here, there)
                covs.append(UNKNOWN)
                own = np.zeros((3, 3))
            elif is_node:
                drift, own = follower.add_node(here, there)
                covs.append(turned(drift, -xyyaw[nodes[-1], 2]))
        xyyaw[k], cov[k] = follower.pose, own
        if is_node:
            nodes.append(k)
            clouds.append(here.copy())
            faces.append(there.copy())
            is_break.append(broken)
    rows = np.array(nodes, dtype=np.int64)
    score = np.array([np.nan if f is None else f.score for f in fits])
    return LocalTrajectory(
        scans.t_ns,
        xyyaw,
        score,
        rows,
        tuple(clouds),
        mount[:2].copy(),
        np.where(np.isfinite(score[rows]), score[rows], 1.0),
        np.array(covs).reshape(-1, 3, 3),
        np.array(is_break, dtype=bool),
        tuple(faces),
        cov,
        tuple(fits),
    )


def _moved(pose: se2.Array, node: se2.Array, config: MatchConfig) -> bool:
    dx, dy, turn = pose[0] - node[0], pose[1] - node[1], pose[2] - node[2]
    turn = abs((turn + np.pi) % (2.0 * np.pi) - np.pi)
    return bool(dx * dx + dy * dy > config.node_m**2 or turn > config.node_rad)
