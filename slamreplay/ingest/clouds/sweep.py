"""How the base moved while a cloud was being swept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, Times
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.clouds.point_times import PointTimes

#: Poses between which the motion of one sweep is taken to be even.
_PIECES = 8


@dataclass(frozen=True, eq=False)
class SweepMotion:
    """The base during each of N sweeps, seen from where it was at the cloud's stamp.

    Attributes:
        late_s: (P,) float32 s of each point after the stamp, NaN where not known; empty where
            nothing is to be taken out.
        from_s: (N,) s after the stamp of the first pose.
        step_s: (N,) s between poses.
        xyyaw: (N, K, 3) the poses.
        still: clouds that are left as they are, for their times or the motion are not known.
    """

    late_s: NDArray[np.float32]
    from_s: se2.Array
    step_s: se2.Array
    xyyaw: se2.Array
    still: int

    @classmethod
    def none(cls, count: int) -> SweepMotion:
        """Of clouds that are left as they are."""
        empty = np.empty(0, dtype=np.float32)
        return cls(empty, np.zeros(count), np.ones(count), np.zeros((count, 2, 3)), 0)


def sweep_motion(
    clouds: Clouds, t_ns: Times, times: PointTimes | None, track: PoseTrack | None
) -> SweepMotion:
    """The motion within N sweeps.

    Args:
        clouds: the sweeps.
        t_ns: (N,) their stamps on the clock of the track.
        times: what the times of their points mean, None where they have none.
        track: the base in a frame that does not jump, None without odometry.
    """
    n = len(clouds)
    if times is None or track is None or clouds.time is None or not n:
        return SweepMotion.none(n)
    late_s, sound = times.after_stamp_s(clouds)
    low, high = np.zeros(n), np.full(n, 1e-3)
    filled = np.flatnonzero(np.diff(clouds.offsets) > 0)
    if len(filled):
        starts = clouds.offsets[filled]
        low[filled] = np.nan_to_num(np.fmin.reduceat(late_s, starts), nan=0.0)
        high[filled] = np.nan_to_num(np.fmax.reduceat(late_s, starts), nan=0.0)
    step = np.maximum((high - low) / _PIECES, 1e-6)
    knots = low[:, None] + np.arange(_PIECES + 1) * step[:, None]
    at = t_ns[:, None] + np.rint(knots * NS_PER_S).astype(np.int64)
    poses = track.at(at.ravel()).xyyaw.reshape(n, _PIECES + 1, 3)
    moved = se2.between(track.at(t_ns).xyyaw[:, None], poses)
    is_known = np.asarray(np.isfinite(moved).all(axis=(1, 2)))
    # Beyond the odometry a sweep is left as it is: half of it moved would tear it apart.
    moved[~is_known] = 0.0
    still = int((~(sound & is_known)).sum())
    return SweepMotion(late_s, low, step, moved, still)
