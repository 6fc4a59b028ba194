"""SLAM over a whole log: local trajectory, submaps, closures, and the graph of all nodes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.inputs import need_scans
from slamreplay.estimators.pose_graph.beginning import Beginning, beginning
from slamreplay.estimators.pose_graph.candidates import Closed
from slamreplay.estimators.pose_graph.closing import close_loops
from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.estimators.pose_graph.doubt import doubted
from slamreplay.estimators.pose_graph.smoothing import Smoothed, smoothed
from slamreplay.estimators.pose_graph.submaps import Submaps, chain_covariances, submaps
from slamreplay.estimators.scales import MIN_SCORE, scales_of
from slamreplay.estimators.scan_matching.local import LocalTrajectory, local_trajectory_of
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import composed


@dataclass(frozen=True, eq=False)
class Slam:
    """All that was made of a log.

    Attributes:
        start: pose of the first node, and the frame.
        local: every scan in the local frame, and the nodes.
        maps: the submaps.
        closed: the closures, and what was believed when each submap was done.
        smoothed: the nodes once everything is known; None in the online mode.
    """

    start: Beginning
    local: LocalTrajectory
    maps: Submaps
    closed: Closed
    smoothed: Smoothed | None


def slam_of(view: BundleView, config: GraphConfig, estimator: str, *, is_online: bool) -> Slam:
    """Build map and graph.

    Args:
        view: the log; its settings `min_score`, `process_noise_scale` and
            `measurement_noise_scale` are ratios of the configuration and of the covariances.
        config: hyper-parameters.
        estimator: who asks.
        is_online: whether only what the closures said on the way counts.

    Raises:
        NotApplicableError: no scans, or none with enough points.
    """
    need_scans(view, estimator)
    odometry = odometry_track(view)
    local = local_trajectory_of(view)
    if not len(local.nodes):
        raise NotApplicableError("no scan has enough points to be matched", where=estimator)
    local = replace(local, motion_cov=doubted(local, odometry))
    motion_scale, match_scale = scales_of(view)
    config = replace(config, min_score=view.settings.get(MIN_SCORE, 1.0) * config.min_score)
    start = beginning(view, local, config, match_scale)
    maps = submaps(local, config.submap_m, config.apart_m, motion_scale)
    nodes, at = local.node_xyyaw, int(maps.reference[0])
    way = np.array([0, at])
    inside = np.zeros((3, 3))
    if at:
        inside = chain_covariances(nodes, local.motion_cov * motion_scale, way)[0]
    motion = se2.between(nodes[0], nodes[at])
    closed = close_loops(
        maps,
        se2.compose(start.xyyaw, motion),
        composed(start.xyyaw, start.cov, motion, inside),
        config,
        match_scale,
        with_cov=is_online,
    )
    end = None
    if not is_online:
        end = smoothed(
            local, maps, closed, start.xyyaw, start.cov, config, motion_scale, match_scale
        )
    return Slam(start, local, maps, closed, end)
