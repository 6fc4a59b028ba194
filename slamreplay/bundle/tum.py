"""Trajectories as TUM lines, for evo and its kin."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import Times, decimal_seconds


def tum(track: PoseTrack) -> str:
    """A planar track as TUM lines, sorted by time; rows without pose are left out."""
    rows = np.flatnonzero(track.has_pose)
    rows = rows[np.argsort(track.t_ns[rows], kind="stable")]
    return tum_lines(track.t_ns[rows], track.xyyaw[rows])


def tum_lines(t_ns: Times, xyyaw: se2.Array) -> str:
    """Lines `t x y z qx qy qz qw` of times (N,) and poses (N, 3) in their order; nan without pose.

    Times are s with nine decimals by integer arithmetic: as a float they would lose nanoseconds.
    """
    turn = se3.quaternion_from_yaw(xyyaw[:, 2]) + 0.0  # adding 0 makes -0 a plain 0
    turn[np.isnan(xyyaw).any(axis=1)] = np.nan
    place = np.round(xyyaw[:, :2], 6) + 0.0
    return "".join(
        f"{decimal_seconds(int(t))} {x:.6f} {y:.6f} 0.000000 {qx:.9f} {qy:.9f} {qz:.9f} {qw:.9f}\n"
        for t, (x, y), (qx, qy, qz, qw) in zip(t_ns, place, turn, strict=True)
    )
