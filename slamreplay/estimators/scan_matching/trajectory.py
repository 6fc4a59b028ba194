"""The trajectory that scan matching gives: every scan in a local frame that drifts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.scan_matching.fit import Fit
from slamreplay.geometry import se2


@dataclass(frozen=True, eq=False)
class LocalTrajectory:
    """Every scan in a frame that drifts and only jumps at breaks, and the nodes of a graph.

    Attributes:
        t_ns: (N,) times of the scans.
        xyyaw: (N, 3) the base at every scan, m, m, rad; NaN before the first usable scan.
        scan_score: (N,) how well each scan fits the map before it, 0 to 1; NaN where not matched.
        nodes: (K,) rows of the scans that are nodes, ascending.
        points: K clouds (M, 2) of the nodes in the base frame at their stamps, deskewed.
        laser_xy: (2,) where the beams start, in the base frame.
        score: (K,) of the nodes; 1 for the first.
        motion_cov: (K - 1, 3, 3) covariance of the map's drift from node k to k + 1, about axes of
            the base at node k, m^2 and rad^2; large where it is a break. These add up over the
            nodes. What a node misses by itself, and its neighbours do not, is in `cov`.
        is_break: (K,) nothing before was found in its scan: the motion to it is not known.
        normals: K arrays (M, 2), which way the surface at each point faces, in the base frame; 0
            where that is not known.
        cov: (N, 3, 3) covariance of each pose against the node before it, axes of the local frame;
            of a node itself, only what its scan misses beside the map's drift.
        fits: N, how each scan came to its pose; None where there was nothing to match to.
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
    normals: tuple[se2.Array, ...]
    cov: se2.Array
    fits: tuple[Fit | None, ...]

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
