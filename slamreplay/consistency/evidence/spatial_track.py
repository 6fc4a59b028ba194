"""A pose in space over time, and how a robot that lives in space is told from a planar one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.covariance_faults import LEAST, MOST, MOST_RAD2
from slamreplay.geometry import se3
from slamreplay.geometry.covariance import is_positive_definite, ros_of_other_point
from slamreplay.geometry.se2 import Array

#: z, roll and pitch in ROS's order of a 6x6 covariance.
_OFF_PLANE = np.array([2, 3, 4])
_MOST = np.array([MOST, MOST_RAD2, MOST_RAD2])
#: m and rad: what moves by less than this only does so by rounding.
_FLAT = 1e-6


@dataclass(frozen=True, eq=False)
class SpatialTrack:
    """Poses of one frame in another over time.

    Attributes:
        frame_id: frame the poses are given in.
        t_ns: (N,) times on the bundle's clock, ascending.
        T: (N, 4, 4) T_parent_body; NaN where there is no pose.
        cov: (N, 6, 6) as ROS gives it: x y z rx ry rz about the parent's axes, m^2 and rad^2; NaN
            where the source gives none.
    """

    frame_id: str
    t_ns: NDArray[np.int64]
    T: Array
    cov: Array

    def mounted(self, T_body_other: Array) -> SpatialTrack:
        """The track of another frame that sits on the same body at T_body_other (N, 4, 4)."""
        lever = np.einsum("nij,nj->ni", self.T[:, :3, :3], T_body_other[:, :3, 3])
        cov = ros_of_other_point(self.cov, lever)
        return SpatialTrack(self.frame_id, self.t_ns, self.T @ T_body_other, cov)

    def at(self, at_ns: NDArray[np.int64], max_gap_ns: int) -> SpatialTrack:
        """Poses at other times (M,), turning steadily between samples; their earlier covariance.

        A time is answered only between two samples no farther apart than `max_gap_ns`, or at a
        sample; elsewhere the pose is NaN: it is never extrapolated.
        """
        rows = np.flatnonzero(np.isfinite(self.T).all(axis=(1, 2)))
        T = np.full((len(at_ns), 4, 4), np.nan)
        cov = np.full((len(at_ns), 6, 6), np.nan)
        if len(rows):
            t = self.t_ns[rows]
            low = np.clip(np.searchsorted(t, at_ns, side="right") - 1, 0, len(t) - 1)
            high = np.minimum(low + 1, len(t) - 1)
            gap = t[high] - t[low]
            inside = (at_ns > t[low]) & (at_ns <= t[high]) & (gap <= max_gap_ns)
            share = np.where(inside, (at_ns - t[low]) / np.maximum(gap, 1), 0.0)
            known = inside | (t[low] == at_ns)
            between = _between(self.T[rows[low]], self.T[rows[high]], share)
            T[known], cov[known] = between[known], self.cov[rows[low]][known]
        return SpatialTrack(self.frame_id, at_ns, T, cov)

    @property
    def leaves_plane(self) -> bool:
        """Whether height, roll and pitch are more than constants: those of planar robots are."""
        R = self.T[:, :3, :3]
        pitch, roll = R[:, 2, 0], R[:, 2, 1]
        return all(_range(x) > _FLAT for x in (self.T[:, 2, 3], roll, pitch))

    @property
    def claims_space(self) -> bool:
        """Whether the covariance says something about height, roll and pitch.

        Where most of its rows are positive definite in all six axes, their variances of z, roll
        and pitch are not those that stand for "not measured", and no one of them is a constant.
        """
        variance = np.diagonal(self.cov, axis1=1, axis2=2)[:, _OFF_PLANE]
        with np.errstate(invalid="ignore"):
            sound = ((variance > LEAST) & (variance < _MOST)).all(axis=1)
        sound &= is_positive_definite(self.cov)
        given = np.isfinite(self.cov[:, 0, 0])
        varies = [_range(v) > 1e-9 * v.max(initial=0.0) for v in variance[sound].T]
        return bool(2 * sound.sum() > given.sum()) and all(varies)


def _between(T_low: Array, T_high: Array, share: Array) -> Array:
    """(M, 4, 4) on the way from one pose to the next, a share (M,) of it behind."""
    T = T_low.copy()
    R = T_low[:, :3, :3]
    turn = se3.rotation_vector(T_high[:, :3, :3] @ np.swapaxes(R, 1, 2))
    T[:, :3, :3] = se3.rotation_from_vector(share[:, None] * turn) @ R
    T[:, :3, 3] += share[:, None] * (T_high[:, :3, 3] - T_low[:, :3, 3])
    return T


def _range(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if len(known) else 0.0
