"""hindsight.tum: the rebuilt trajectory for evo and its kin."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se3
from slamreplay.geometry.times import decimal_seconds


def tum(track: PoseTrack) -> str:
    """A planar track as TUM lines `t x y z qx qy qz qw`, sorted; rows without pose are left out.

    Times are s with nine decimals by integer arithmetic: as a float they would lose nanoseconds.
    """
    rows = np.flatnonzero(track.has_pose)
    rows = rows[np.argsort(track.t_ns[rows], kind="stable")]
    turn = se3.quaternion_from_yaw(track.xyyaw[rows, 2]) + 0.0  # adding 0 makes -0 a plain 0
    place = np.round(track.xyyaw[rows, :2], 6) + 0.0
    return "".join(
        f"{decimal_seconds(int(t))} {x:.6f} {y:.6f} 0.000000 {qx:.9f} {qy:.9f} {qz:.9f} {qw:.9f}\n"
        for t, (x, y), (qx, qy, qz, qw) in zip(track.t_ns[rows], place, turn, strict=True)
    )
