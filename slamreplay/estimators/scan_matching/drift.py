"""How far the local frame has drifted: covariances of all poses since one of them was known."""

from __future__ import annotations

import numpy as np

from slamreplay.estimators.scan_matching.trajectory import LocalTrajectory
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import composed, swing, turned


def drifted(local: LocalTrajectory, row: int, cov: se2.Array) -> se2.Array:
    """Covariances (N, 3, 3) of the poses about axes of the local frame; NaN before `row`.

    What the motions between nodes miss adds up; a scan misses its own part on top, and so did the
    one at which the pose was known.

    Args:
        local: the trajectory.
        row: at which the pose is known.
        cov: (3, 3) of it, about axes of the local frame.
    """
    out = np.full((len(local.xyyaw), 3, 3), np.nan)
    nodes, first = local.node_xyyaw, int(local.node_of[row])
    links = se2.between(nodes[:-1], nodes[1:])
    # Of each node against the first one, about axes of the local frame, the start's part apart.
    since = np.zeros((len(nodes), 3, 3))
    for k in range(first, len(nodes) - 1):
        since[k + 1] = composed(nodes[k], since[k], links[k], local.motion_cov[k])
    rows = np.arange(row, len(local.xyyaw))
    at = local.node_of[rows]
    by = swing(local.xyyaw[rows], nodes[at])
    noise = by @ since[at] @ np.swapaxes(by, 1, 2) + local.cov[rows]
    by = swing(local.xyyaw[rows], local.xyyaw[row])
    out[rows] = noise + by @ (cov + local.cov[row]) @ np.swapaxes(by, 1, 2)
    out[row] = cov
    return 0.5 * (out + np.swapaxes(out, 1, 2))


def in_frame(T_frame_local: se2.Array, cov: se2.Array) -> se2.Array:
    """Covariances (N, 3, 3) about the axes of a frame in which the local one lies (3,)."""
    return turned(cov, T_frame_local[2])
