"""Trajectories as TUM lines, for evo and its kin."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import openvins_from_ros, ros_from_planar
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


#: The head of a file as ov_eval's recorder writes it; a comment to every other reader.
OPENVINS_HEAD = (
    "# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12 Pt13 Pt22 Pt23 "
    "Pt33\n"
)


def openvins_lines(t_ns: Times, xyyaw: se2.Array, cov: se2.Array) -> str:
    """The head and lines of times (N,), poses (N, 3) and covariances (N, 3, 3) of x y yaw.

    Rows without pose or covariance are left out: readers take every line's twenty numbers for real.
    Variances of what a planar pose does not have (z, roll, pitch) are zero.
    """
    rows = np.flatnonzero(np.isfinite(xyyaw).all(axis=1) & np.isfinite(cov).all(axis=(1, 2)))
    R = se3.from_planar(xyyaw[rows])[:, :3, :3]
    rotation, position = openvins_from_ros(ros_from_planar(cov[rows]).reshape(-1, 6, 6), R)
    upper = np.triu_indices(3)
    numbers = np.column_stack([rotation[:, *upper], position[:, *upper]]) + 0.0
    poses = tum_lines(t_ns[rows], xyyaw[rows]).splitlines()
    return OPENVINS_HEAD + "".join(
        f"{pose} {' '.join(f'{v:.10g}' for v in row)}\n"
        for pose, row in zip(poses, numbers.tolist(), strict=True)
    )
