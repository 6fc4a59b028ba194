"""The trajectory that scan matching gives: every scan in a local frame that drifts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.scan_matching.config import MatchConfig
from slamreplay.geometry import se2
from slamreplay.matching.correlative import Match, Window, match, search_window
from slamreplay.matching.field import ScoreField, points_field
from slamreplay.matching.thinning import thin

SIGMA_M, SPACING_M, RADIUS_M = 0.08, 0.1, 15.0
GOOD, POOR, GAIN = 0.6, 0.35, 0.08
NARROW = Window(0.2, 0.1, np.radians(8.0), np.radians(2.0), pull=0.03)
CLOSE = Window(0.05, 0.05, np.radians(1.0), np.radians(1.0))
WIDE = Window(1.2, 0.1, np.radians(20.0), np.radians(2.0), pull=0.03)
AROUND = Window(0.6, 0.1, np.pi, np.radians(3.0), pull=0.03)
LEAST_POINTS = 10


@dataclass(frozen=True, eq=False)
class LocalTrajectory:
    """Every scan in a frame that drifts but does not jump, but for breaks, and the nodes of a graph.

    Attributes:
        t_ns: (N,) times of the scans.
        xyyaw: (N, 3) the base at every scan, m, m, rad; NaN before the first usable scan.
        scan_score: (N,) how well each scan fits the map before it, 0 to 1; NaN where not matched.
        nodes: (K,) rows of the scans that are nodes, ascending.
        points: K clouds (M, 2) of the nodes in the base frame at their stamps, deskewed.
        laser_xy: (2,) where the beams start, in the base frame.
        score: (K,) of the nodes; 1 for the first.
        motion_cov: (K - 1, 3, 3) covariance of the motion from node k to k + 1, about axes of the
            base at node k, m^2 and rad^2; large where it is a break.
        is_break: (K,) nothing before was found in its scan: the motion to it is not known.
    """

    t_ns: NDArray[np.int64]
    xyyaw: se2.Array
    scan_score: se2.Array
    nodes: NDArray[np.int64]
    points: tuple[se2.Array, ...]
    laser_xy: se2.Array
    score: se2.Array
    motion_cov: se2.Array
    is_break: NDArray[np.bool_]

    @property
    def node_xyyaw(self) -> se2.Array:
        """(K, 3) the nodes' poses."""
        return np.asarray(self.xyyaw[self.nodes])

    @property
    def node_of(self) -> NDArray[np.int64]:
        """(N,) number of the node at or before each scan; -1 before the first."""
        return np.searchsorted(self.nodes, np.arange(len(self.xyyaw)), side="right") - 1

    def carried(self, node_xyyaw: se2.Array) -> se2.Array:
        """Poses (N, 3) of all scans where the nodes are moved to (K, 3): each by its local pose.

        A scan between two nodes keeps its place to the one before; what the move leaves at the one
        after is spread evenly by the way between them.
        """
        return np.asarray(_carried(self, node_xyyaw))


def _carried(local: LocalTrajectory, poses: se2.Array) -> se2.Array:
    out = np.full_like(local.xyyaw, np.nan)
    node = local.node_of
    rows = np.flatnonzero(node >= 0)
    if not len(rows):
        return out
    low = node[rows]
    high = np.minimum(low + 1, len(local.nodes) - 1)
    high = np.where(local.is_break[high], low, high)
    first, last = local.nodes[low], local.nodes[high]
    part = (rows - first) / np.maximum(last - first, 1)
    here = se2.compose(poses[low], se2.between(local.xyyaw[first], local.xyyaw[rows]))
    back = se2.compose(poses[high], se2.between(local.xyyaw[last], local.xyyaw[rows]))
    off = back - here
    off[:, 2] = se2.wrap_angle(off[:, 2])
    here += part[:, None] * off
    here[:, 2] = se2.wrap_angle(here[:, 2])
    out[rows] = here
    return out


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
    n = len(scans)
    told = np.full((n, 3), np.nan) if odometry is None else odometry.at(scans.t_ns).xyyaw
    xyyaw, score = np.full((n, 3), np.nan), np.full(n, np.nan)
    nodes: list[int] = []
    points: list[se2.Array] = []
    breaks: list[bool] = []
    covs: list[se2.Array] = []
    memory: list[se2.Array] = []
    field: ScoreField | None = None
    last, before = -1, -1
    for k in range(n):
        cloud = scans.points(k)
        cloud = cloud[np.hypot(*cloud.T) < 40.0]
        scan = thin(cloud, SPACING_M)
        if last < 0:
            if len(scan) < LEAST_POINTS:
                continue
            xyyaw[k] = 0.0
            nodes, points, breaks, last, before = [k], [thin(cloud, 0.05)], [False], k, k
            memory, field, score[k] = [scan], points_field(scan, SIGMA_M), 1.0
            continue
        step = se2.between(told[before], told[k])
        if not np.isfinite(step).all():
            step = np.zeros(3) if before < 1 else se2.between(xyyaw[before - 1], xyyaw[before])
            step = np.where(np.isfinite(step), step, 0.0)
        guess = se2.compose(xyyaw[before], step)
        laid = Match(guess, 0.0, np.zeros((3, 3)))
        if field is not None and len(scan) >= LEAST_POINTS:
            laid = _lay(field, scan, guess, xyyaw[before])
        lost = laid.score < POOR
        xyyaw[k], score[k] = guess if lost else laid.xyyaw, laid.score
        before = k
        way = se2.between(xyyaw[last], xyyaw[k])
        if len(scan) < LEAST_POINTS:
            continue
        if not (np.hypot(way[0], way[1]) > config.node_m or abs(way[2]) > config.node_rad):
            continue
        cov = np.diag([0.01, 0.01, 0.005]) ** 2
        covs.append(np.eye(3) if lost else cov)
        nodes.append(k)
        points.append(thin(cloud, 0.05))
        breaks.append(bool(lost))
        last = k
        memory = [] if lost else memory[1 - config.memory :]
        memory.append(se2.transform_points(xyyaw[k], scan))
        whole = np.concatenate(memory)
        near = (np.abs(whole - xyyaw[k, :2]) < RADIUS_M).all(axis=1)
        field = points_field(whole[near], SIGMA_M) if near.any() else None
    rows = np.array(nodes, dtype=np.int64)
    return LocalTrajectory(
        scans.t_ns,
        xyyaw,
        score,
        rows,
        tuple(points),
        scans.xyyaw_base_laser[:2].copy(),
        score[rows],
        np.array(covs).reshape(-1, 3, 3),
        np.array(breaks, dtype=bool),
    )


def _lay(field: ScoreField, scan: se2.Array, guess: se2.Array, last: se2.Array) -> Match:
    start, _ = search_window(field, scan[::2], guess, NARROW)
    best = match(field, scan, start, CLOSE)
    if best.score < GOOD:
        for centre, window in ((guess, WIDE), (last, AROUND)):
            wide = match(field, scan[::2], centre, window)
            wide = match(field, scan, wide.xyyaw, Window(0.1, 0.05, 0.04, 0.02))
            best = wide if wide.score > best.score + GAIN else best
    return best
