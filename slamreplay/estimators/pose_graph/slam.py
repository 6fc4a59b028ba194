"""SLAM over a whole log: local trajectory, submaps, closures, and the graph of all nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.inputs import need_scans
from slamreplay.estimators.pose_graph.closing import Closed, close_loops
from slamreplay.estimators.pose_graph.config import CERTAIN, GraphConfig
from slamreplay.estimators.pose_graph.smoothing import Smoothed, smoothed
from slamreplay.estimators.pose_graph.submaps import Submaps, chain_covariances, submaps
from slamreplay.estimators.scan_matching.local import LocalTrajectory, local_trajectory
from slamreplay.estimators.start import starts
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import composed, swing

#: Settings a perturbation may change beside those of the start.
MIN_SCORE = "min_score"
PROCESS_NOISE, MEASUREMENT_NOISE = "process_noise_scale", "measurement_noise_scale"


@dataclass(frozen=True, eq=False)
class Slam:
    """All that was made of a log.

    Attributes:
        frame_id: frame of the poses.
        start_row: from which row on the start holds; 0 where there is none.
        first: (3,) pose of the first node.
        first_cov: (3, 3) of it.
        local: every scan in the local frame, and the nodes.
        maps: the submaps.
        closed: the closures, and what was believed when each submap was done.
        smoothed: the nodes once everything is known; None in the online mode.
    """

    frame_id: str
    start_row: int
    first: se2.Array
    first_cov: se2.Array
    local: LocalTrajectory
    maps: Submaps
    closed: Closed
    smoothed: Smoothed | None


def slam_of(view: BundleView, config: GraphConfig, estimator: str, *, is_online: bool) -> Slam:
    """Build map and graph.

    Args:
        view: the log; its settings `min_score`, `process_noise_scale` and
            `measurement_noise_scale` change the configuration and the covariances.
        config: hyper-parameters.
        estimator: who asks.
        is_online: whether only what the closures said on the way counts.

    Raises:
        NotApplicableError: no scans, or none with enough points.
    """
    scans = need_scans(view, estimator)
    local = local_trajectory(scans, odometry_track(view))
    if not len(local.nodes):
        raise NotApplicableError("no scan has enough points to be matched", where=estimator)
    motion_scale = view.settings.get(PROCESS_NOISE, 1.0)
    match_scale = view.settings.get(MEASUREMENT_NOISE, 1.0)
    frame, row, first, first_cov = _start(view, local)
    maps = submaps(local, config.submap_m, config.apart_m, motion_scale)
    nodes, at = local.node_xyyaw, int(maps.reference[0])
    way = np.array([0, at])
    inside = chain_covariances(nodes, local.motion_cov * motion_scale, way)[0] if at else CERTAIN
    motion = se2.between(nodes[0], nodes[at])
    closed = close_loops(
        maps,
        se2.compose(first, motion),
        composed(first, first_cov, motion, inside),
        config,
        match_scale,
        with_cov=is_online,
    )
    end = None
    if not is_online:
        end = smoothed(local, maps, closed, first, first_cov, config, motion_scale, match_scale)
    return Slam(frame, row, first, first_cov, local, maps, closed, end)


def _start(view: BundleView, local: LocalTrajectory) -> tuple[str, int, se2.Array, se2.Array]:
    """Frame, row of the start, and pose and covariance of the first node.

    Only the start is taken from the log's map: what the robot is then, the graph finds out itself.
    """
    frames, node = view.manifest.frames, local.node_xyyaw[0]
    given = starts(view, local.t_ns, local.xyyaw)
    if not given or given[0].xyyaw is None:
        return frames.odom or "odom", 0, node, CERTAIN
    start, there = given[0], given[0].xyyaw
    first = se2.compose(there, se2.between(local.xyyaw[start.row], node))
    by = swing(first, there)
    return frames.map or "map", start.row, first, by @ start.cov @ by.T
