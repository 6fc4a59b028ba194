"""The residual ledger: every match, taken or not, against what was expected before it."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.run import Innovations
from slamreplay.estimators.scan_matching.trajectory import LocalTrajectory
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned

AXES = ("x m", "y m", "yaw rad")


def match_innovations(
    local: LocalTrajectory, frame_id: str = "local", yaw: float = 0.0
) -> Innovations:
    """A row for each scan that was matched: the pose of the match alone minus the prediction.

    Args:
        local: the trajectory.
        frame_id: in whose axes residuals are told.
        yaw: of the local frame in it, rad.
    """
    found = [(k, fit) for k, fit in enumerate(local.fits) if fit is not None and fit.is_matched]
    n = len(found)
    rows = np.array([k for k, _ in found], dtype=np.int64)
    return Innovations(
        "scan match",
        local.t_ns[rows],
        _turned(np.array([f.residual for _, f in found]).reshape(n, 3), yaw),
        turned(np.array([f.S for _, f in found]).reshape(n, 3, 3), yaw),
        np.array([f.accepted for _, f in found], dtype=bool),
        AXES,
        frame_id,
        _turned(np.array([f.moved for _, f in found]).reshape(n, 3), yaw),
        np.array([f"scan {k}" for k in rows.tolist()], dtype=np.str_),
        np.array([f.score for _, f in found]),
    )


def _turned(off: se2.Array, yaw: float) -> se2.Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack(
        [c * off[:, 0] - s * off[:, 1], s * off[:, 0] + c * off[:, 1], off[:, 2]]
    )
