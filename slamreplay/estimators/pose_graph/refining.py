"""Nodes laid onto nodes of other passes: dense, precise relations once loops are closed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.geometry import se2
from slamreplay.graph.relations import Relations
from slamreplay.matching.pair_lines import ScanLines, lay_pairs

#: How far partners of points are looked for, round by round, m.
REACH_M = (0.3, 0.2, 0.15)
#: A turn of a radian makes a node as far away as this, when the nearest are chosen, m.
TURN_M = 0.5
#: Of so many nodes in a row one is enough.
ROW = 3
#: Nodes of the same pass are less than this apart along the way, m.
SAME_PASS_M = 5.0
#: Information that any relation has: 10 m, 10 rad.
LEAST_INFORMATION = 0.01
#: What is left of a relation's error at the least: m, rad.
LEAST_M, LEAST_RAD = 0.005, 0.001


@dataclass(frozen=True, eq=False)
class Overlap:
    """Relations between nodes of different passes, and (E,) `score` share of points that fit."""

    relations: Relations
    score: se2.Array


def overlapping(poses: se2.Array, way: se2.Array, config: GraphConfig) -> NDArray[np.int64]:
    """Pairs (E, 2) of nodes of different passes that see the same, the earlier one first.

    Args:
        poses: (K, 3) of the nodes.
        way: (K,) to each, m.
        config: hyper-parameters.
    """
    near = cKDTree(poses[:, :2]).query_pairs(config.pass_m, output_type="ndarray")
    near = np.sort(near.astype(np.int64), axis=1)
    near = near[way[near[:, 1]] - way[near[:, 0]] > SAME_PASS_M]
    if not len(near):
        return near.reshape(-1, 2)
    step = poses[near[:, 0]] - poses[near[:, 1]]
    cost = np.hypot(step[:, 0], step[:, 1]) + TURN_M * np.abs(se2.wrap_angle(step[:, 2]))
    row = near[:, 1] * len(poses) + near[:, 0] // ROW
    near, cost = _first(near, cost, row, 1)
    near, _ = _first(near, cost, near[:, 1], config.passes)
    return near


def _first(
    pairs: NDArray[np.int64], cost: se2.Array, group: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int64], se2.Array]:
    """The cheapest `count` of each group."""
    order = np.lexsort((pairs[:, 0], cost, group))
    sorted_group = group[order]
    begin = np.searchsorted(sorted_group, sorted_group, side="left")
    kept = order[np.arange(len(order)) - begin < count]
    return pairs[kept], cost[kept]


def laid_on_passes(
    lines: ScanLines,
    pairs: NDArray[np.int64],
    poses: se2.Array,
    number: int,
    config: GraphConfig,
    match_scale: float,
) -> Overlap:
    """One round of laying nodes onto each other.

    A scan takes part in several pairs, and its own noise in all of them: each relation gets its
    share only, the information of its points over the number of pairs of its nodes.

    Args:
        lines: of the nodes' scans.
        pairs: (E, 2) nodes.
        poses: (K, 3) of the nodes.
        number: of the round, from 0 on.
        config: hyper-parameters.
        match_scale: ratio by which covariances are changed.
    """
    reach = REACH_M[min(number, len(REACH_M) - 1)]
    expected = se2.between(poses[pairs[:, 0]], poses[pairs[:, 1]])
    laid = lay_pairs(lines, pairs, expected, reach, max(2.0 * config.sigma_m, reach / 4.0))
    fits = laid.share > config.min_score
    pairs = pairs[fits]
    degree = np.bincount(pairs.ravel(), minlength=len(poses))
    often = np.sqrt(degree[pairs[:, 0]] * degree[pairs[:, 1]])
    variance = config.sigma_m**2 * config.points_per_fact * often
    information = laid.per_point[fits] / variance[:, None, None] + LEAST_INFORMATION * np.eye(3)
    floor = np.diag(np.square([LEAST_M, LEAST_M, LEAST_RAD]))
    cov = (np.linalg.inv(information) + floor) * match_scale
    cov = (cov + np.swapaxes(cov, 1, 2)) / 2.0
    return Overlap(Relations(pairs, laid.xyyaw[fits], cov), laid.share[fits])
