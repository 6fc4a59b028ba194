"""The graph of all nodes: their motions, the closures, and what passes say of each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.estimators.pose_graph.candidates import Closed
from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.estimators.pose_graph.refining import laid_on_passes, overlapping
from slamreplay.estimators.pose_graph.submaps import Submaps
from slamreplay.estimators.scan_matching.local import LocalTrajectory
from slamreplay.geometry import se2
from slamreplay.graph.relations import Relations, solved
from slamreplay.matching.pair_lines import ScanLines

#: Nodes that move less than this on average are where they belong, m.
STILL_M = 0.002


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Where the nodes are once everything is known.

    Attributes:
        xyyaw: (K, 3).
        cov: (K, 3, 3) about the parent's axes.
        closures: between nodes, those that were accepted.
        switches: of them, how far each is switched on, 0 to 1.
        passes: relations between nodes of different passes.
        moved_m: mean way of the nodes in each round of refinement.
    """

    xyyaw: se2.Array
    cov: se2.Array
    closures: Relations
    switches: se2.Array
    passes: Relations
    moved_m: tuple[float, ...]


def smoothed(
    local: LocalTrajectory,
    maps: Submaps,
    closed: Closed,
    first: se2.Array,
    first_cov: se2.Array,
    config: GraphConfig,
    motion_scale: float = 1.0,
    match_scale: float = 1.0,
) -> Smoothed:
    """Optimise all nodes, and lay them onto those of other passes until they hold still.

    Args:
        local: the nodes and their motions.
        maps: the submaps.
        closed: the closures between them.
        first: (3,) pose of the first node.
        first_cov: (3, 3) of it.
        config: hyper-parameters.
        motion_scale: ratio by which covariances of motions are changed.
        match_scale: and of matches.
    """
    nodes, count = local.node_xyyaw, len(local.nodes)
    pairs = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    motions = Relations(pairs, se2.between(nodes[:-1], nodes[1:]), local.motion_cov * motion_scale)
    submap_closures = closed.relations()
    closures = Relations(
        maps.reference[submap_closures.pairs], submap_closures.xyyaw, submap_closures.cov
    )
    guess = spread(nodes, maps, closed.poses)
    guess[0] = first
    poses = solved(guess, first_cov, motions, closures, config.phi).xyyaw
    passes, moved = Relations.none(), []
    lines = ScanLines.of(local.points, local.normals, local.laser_xy)
    for number in range(config.rounds):
        pairs = overlapping(poses, maps.way, config)
        if not len(pairs):
            break
        passes = laid_on_passes(lines, pairs, poses, number, config, match_scale).relations
        doubtful = joined(closures, passes)
        after = solved(poses, first_cov, motions, doubtful, config.phi, most_steps=1).xyyaw
        step = np.hypot(*(after - poses)[:, :2].T)
        poses = after
        moved.append(float(step.mean()))
        if moved[-1] < STILL_M:
            break
    doubtful = joined(closures, passes)
    end = solved(poses, first_cov, motions, doubtful, config.phi, with_cov=True, most_steps=0)
    switches = closures.switches(end.xyyaw, config.phi)
    return Smoothed(end.xyyaw, end.cov, closures, switches, passes, tuple(moved))


def joined(one: Relations, two: Relations) -> Relations:
    """Both together."""
    return Relations(
        np.concatenate([one.pairs, two.pairs]),
        np.concatenate([one.xyyaw, two.xyyaw]),
        np.concatenate([one.cov, two.cov]),
    )


def spread(nodes: se2.Array, maps: Submaps, poses: se2.Array) -> se2.Array:
    """(K, 3) where nodes lie when the references of their submaps are moved to `poses` (C, 3).

    Each keeps its local place to the reference before and to that after; what these leave is spread
    evenly between them.
    """
    at, k = maps.reference, np.arange(len(nodes))
    low = np.clip(np.searchsorted(at, k, side="right") - 1, 0, len(at) - 1)
    high = np.minimum(low + 1, len(at) - 1)
    here = se2.compose(poses[low], se2.between(nodes[at[low]], nodes))
    back = se2.compose(poses[high], se2.between(nodes[at[high]], nodes))
    part = np.clip((k - at[low]) / np.maximum(at[high] - at[low], 1), 0.0, 1.0)
    off = back - here
    off[:, 2] = se2.wrap_angle(off[:, 2])
    out = here + part[:, None] * off
    out[:, 2] = se2.wrap_angle(out[:, 2])
    return np.asarray(out)
