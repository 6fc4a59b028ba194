"""Motions on which wheels and scans disagree: one of the two is wrong, and nobody knows which."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.scan_matching.local import LocalTrajectory
from slamreplay.geometry import se2

#: What odometry misses of a motion between two nodes, at the least and per metre and radian: so
#: roughly that only a slip, or a match that slid, stands out.
LEAST_M, PER_METRE, PER_RADIAN = 0.02, 0.1, 0.05
LEAST_RAD, RAD_PER_METRE, RAD_PER_RADIAN = 0.02, 0.05, 0.15
#: Chi-square of 3 degrees of freedom: 99.9 %.
GATE = 16.27
#: Part of the disagreement by which the motion may be wrong in other directions than its own.
ASIDE = 0.2


def doubted(local: LocalTrajectory, odometry: PoseTrack | None) -> se2.Array:
    """Covariances (K - 1, 3, 3) of the motions, larger where odometry says something else.

    There the disagreement itself is added, as its outer product: the motion may be wrong by so
    much in that direction, and by a part of it in every other. A closure then bends the graph
    there and not elsewhere.

    Args:
        local: nodes and motions; of motions over a break nothing is asked.
        odometry: what the wheels say; None, or NaN at a node, doubts nothing.
    """
    if odometry is None or len(local.nodes) < 2:
        return local.motion_cov
    nodes, told = local.node_xyyaw, odometry.at(local.t_ns[local.nodes]).xyyaw
    steps, wheels = se2.between(nodes[:-1], nodes[1:]), se2.between(told[:-1], told[1:])
    off = steps - wheels
    off[:, 2] = se2.wrap_angle(off[:, 2])
    length, turn = np.hypot(wheels[:, 0], wheels[:, 1]), np.abs(wheels[:, 2])
    sigma_m = LEAST_M + PER_METRE * length + PER_RADIAN * turn
    sigma_rad = LEAST_RAD + RAD_PER_METRE * length + RAD_PER_RADIAN * turn
    chi2 = (off[:, 0] ** 2 + off[:, 1] ** 2) / sigma_m**2 + off[:, 2] ** 2 / sigma_rad**2
    odd = (chi2 > GATE) & ~local.is_break[1:]  # not where odometry is NaN
    cov = local.motion_cov.copy()
    cov[odd] += off[odd, :, None] * off[odd, None, :]
    size = np.stack([np.hypot(off[:, 0], off[:, 1])] * 2 + [np.abs(off[:, 2])], axis=1)
    cov[odd] += (ASIDE * size[odd, :, None]) ** 2 * np.eye(3)
    return cov
