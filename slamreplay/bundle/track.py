"""A planar pose over time, with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2

#: Samples this near to each other tell of a robot that stood, where nothing was published between
#: them for no longer than this: in more time it could have been away and back.
STOOD_M, STOOD_RAD, STOOD_NS = 0.05, 0.05, 10_000_000_000


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """Poses of one frame in another over time.

    Attributes:
        frame_id: frame the poses are given in ("map", "odom").
        child_frame_id: frame that is posed, the robot's base.
        t_ns: (N,) int64 times on the bundle's clock, in processing order.
        xyyaw: (N, 3) m, m, rad; NaN rows where there is no pose.
        cov: (N, 3, 3) covariance of x y yaw about the parent's axes, m^2 and rad^2; NaN where the
            source gives none.
    """

    frame_id: str
    child_frame_id: str
    t_ns: NDArray[np.int64]
    xyyaw: se2.Array
    cov: se2.Array

    def __post_init__(self) -> None:
        n = len(self.t_ns)
        if self.xyyaw.shape != (n, 3) or self.cov.shape != (n, 3, 3):
            shapes = f"{self.t_ns.shape}, {self.xyyaw.shape}, {self.cov.shape}"
            raise ValueError(f"shapes of a pose track do not fit: {shapes}")
        for array in (self.t_ns, self.xyyaw, self.cov):
            array.setflags(write=False)

    @classmethod
    def without_covariance(
        cls, frame_id: str, child_frame_id: str, t_ns: NDArray[np.int64], xyyaw: se2.Array
    ) -> PoseTrack:
        """A track whose source gives no covariance: NaN, not zero."""
        cov = np.full((len(t_ns), 3, 3), np.nan)
        return cls(frame_id, child_frame_id, np.asarray(t_ns), np.asarray(xyyaw), cov)

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def has_pose(self) -> NDArray[np.bool_]:
        """(N,) rows with a finite pose."""
        return np.asarray(np.isfinite(self.xyyaw).all(axis=1))

    def take(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> PoseTrack:
        """The rows at an index array or under a mask."""
        return PoseTrack(
            self.frame_id,
            self.child_frame_id,
            self.t_ns[index],
            self.xyyaw[index],
            self.cov[index],
        )

    def at(self, at_ns: NDArray[np.int64], max_gap_ns: int = 1_000_000_000) -> PoseTrack:
        """Poses interpolated at other times; the covariance is the earlier sample's.

        Args:
            at_ns: (M,) asked-for times.
            max_gap_ns: a time is answered only between two samples no farther apart than this, or
                that tell nearly the same pose (a robot that stands publishes seldom), or at a
                sample; elsewhere the pose is NaN: it is never extrapolated.
        """
        at_ns = np.asarray(at_ns, dtype=np.int64)
        rows = np.flatnonzero(self.has_pose)
        rows = rows[np.argsort(self.t_ns[rows], kind="stable")]
        if not len(rows):
            return PoseTrack.without_covariance(
                self.frame_id, self.child_frame_id, at_ns, np.full((len(at_ns), 3), np.nan)
            )
        t = self.t_ns[rows]
        low = np.clip(np.searchsorted(t, at_ns, side="right") - 1, 0, len(t) - 1)
        high = np.minimum(low + 1, len(t) - 1)
        exact = t[low] == at_ns
        gap = t[high] - t[low]
        is_near = (gap <= max_gap_ns) | ((gap <= STOOD_NS) & self._stood(rows[low], rows[high]))
        between = (at_ns > t[low]) & (at_ns <= t[high]) & is_near
        xyyaw = se2.interpolate(t, self.xyyaw[rows], at_ns)
        cov = self.cov[rows[low]]
        outside = ~(exact | between)
        xyyaw[outside], cov[outside] = np.nan, np.nan
        return PoseTrack(self.frame_id, self.child_frame_id, at_ns, xyyaw, cov)

    def _stood(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(M,) pairs of rows between which there was no motion that a gap could hide."""
        off = np.abs(self.xyyaw[high] - self.xyyaw[low])
        return (np.hypot(off[:, 0], off[:, 1]) <= STOOD_M) & (
            np.abs(se2.wrap_angle(off[:, 2])) <= STOOD_RAD
        )
