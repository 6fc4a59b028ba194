"""Where the graph begins: the start that the localizer was given, made precise by the map there.

The log's map is looked at here only. From the first node on the graph has a map of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.estimators.pose_graph.placing import information_of
from slamreplay.estimators.scan_matching.local import LocalTrajectory
from slamreplay.estimators.start import Start, starts
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import swing, turned
from slamreplay.matching.correlative import Window, match, search_window
from slamreplay.matching.field import WorkingMap, points_field, working_map

#: Width of the score about the map's walls, and of what is searched in one go.
SIGMA_M = 0.08
STEP_M, STEP_RAD = 0.1, np.radians(1.5)
MOST_M, MOST_RAD = 1.5, np.radians(45.0)
#: What the edge of the window loses of its score: a start is where it was said to be.
PULL = 0.1
CLOSE = Window(0.05, 0.05, 0.02, 0.02)
POINTS = 200


@dataclass(frozen=True, eq=False)
class Beginning:
    """The first node's pose.

    Attributes:
        frame_id: of the poses: the map's where somebody said a start in it.
        row: from which row on the start holds.
        xyyaw: (3,) of the first node.
        cov: (3, 3) about the frame's axes.
        on_map: score of the first scan on the map; NaN where it was not laid on one.
    """

    frame_id: str
    row: int
    xyyaw: se2.Array
    cov: se2.Array
    on_map: float


def beginning(
    view: BundleView, local: LocalTrajectory, config: GraphConfig, match_scale: float = 1.0
) -> Beginning:
    """The start that holds for the whole graph; later ones would break it and are left out.

    Args:
        view: the log.
        local: every scan in the local frame.
        config: hyper-parameters.
        match_scale: ratio by which the covariance of the look at the map is changed.
    """
    frames, first = view.manifest.frames, local.node_xyyaw[0]
    given = starts(view, local.t_ns, local.xyyaw)
    if not given or given[0].xyyaw is None:
        return Beginning(frames.odom or "odom", 0, first, np.zeros((3, 3)), np.nan)
    start, there = given[0], given[0].xyyaw
    node = max(int(local.node_of[start.row]), 0)
    pose = se2.compose(there, se2.between(local.xyyaw[start.row], local.node_xyyaw[node]))
    by = swing(pose, there)
    moved = Start(0, pose, by @ start.cov @ by.T)
    pose, cov, score = _on_map(view, local.points[node], moved, config, match_scale)
    back = se2.compose(pose, se2.between(local.node_xyyaw[node], first))
    by = swing(back, pose)
    return Beginning(frames.map or "map", start.row, back, by @ cov @ by.T, score)


def _on_map(
    view: BundleView, points: se2.Array, start: Start, config: GraphConfig, match_scale: float
) -> tuple[se2.Array, se2.Array, float]:
    """Pose, covariance and score of a scan laid on the map about a start; the start if in vain."""
    assert start.xyyaw is not None
    held = view.map_course
    grid = view.grid_of(held[0].version) if held else None
    working = None if grid is None else working_map(grid)
    if working is None or not len(points):
        return start.xyyaw, start.cov, np.nan
    faces = _faces(working)
    expected = se2.compose(se2.inverse(working.origin_xyyaw), start.xyyaw)
    sigma = np.sqrt(np.maximum(np.diag(start.cov), 0.0))
    reach_m = float(min(3.0 * max(sigma[0], sigma[1]) + STEP_M, MOST_M))
    reach_rad = float(min(3.0 * sigma[2] + STEP_RAD, MOST_RAD))
    window = Window(reach_m, STEP_M, reach_rad, STEP_RAD, pull=PULL)
    few = points[:: max(1, len(points) // POINTS)]
    far = float(np.abs(points).max()) + reach_m
    faces = faces[(np.abs(faces - expected[:2]) < far * np.sqrt(2.0)).all(axis=1)]
    if not len(faces):
        return start.xyyaw, start.cov, np.nan
    field = points_field(faces, SIGMA_M)
    found, _ = search_window(field, few, expected, window)
    top = match(field, points, found, CLOSE)
    if top.score < config.min_score:
        return start.xyyaw, start.cov, top.score
    # What the map says and what was said before, each as far as it is known.
    turn = working.origin_xyyaw[2]
    R = turned(np.linalg.inv(information_of(top.information, config)), turn)
    R = R + np.diag(np.square([config.closure_m, config.closure_m, config.closure_rad]))
    R = R * match_scale
    off = working.to_map(top.xyyaw) - start.xyyaw
    off[2] = se2.wrap_angle(off[2])
    S = start.cov + R
    if off @ np.linalg.solve(S, off) > config.gate:
        return start.xyyaw, start.cov, top.score
    gain = np.linalg.solve(S, start.cov).T
    pose = start.xyyaw + gain @ off
    pose[2] = se2.wrap_angle(pose[2])
    left = np.eye(3) - gain
    cov = left @ start.cov @ left.T + gain @ R @ gain.T
    return pose, (cov + cov.T) / 2.0, top.score


def _faces(working: WorkingMap) -> se2.Array:
    """(F, 2) middles of the edges between walls and what is free: there beams end."""
    free = ~working.walls & ~working.unknown
    found = []
    for axis in (0, 1):
        one, two = (np.s_[:-1], np.s_[1:]) if axis == 0 else (np.s_[:, :-1], np.s_[:, 1:])
        edge = (working.walls[one] & free[two]) | (free[one] & working.walls[two])
        row, col = np.nonzero(edge)
        at = (col + 0.5, row + 1.0) if axis == 0 else (col + 1.0, row + 0.5)
        found.append(np.column_stack(at))
    return np.asarray(working.corner_xy + np.concatenate(found) * working.resolution_m)
