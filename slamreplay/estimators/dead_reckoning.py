"""Odometry carried on from the start: what the robot knows without looking."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.estimators.inputs import need_odometry
from slamreplay.estimators.scales import PROCESS_NOISE, scales_of
from slamreplay.estimators.start import MOVED, Start, starts
from slamreplay.geometry import se2


@dataclass(frozen=True)
class DeadReckoning:
    """Carry odometry on from the first known pose; the covariance grows with distance and turn.

    In the map where the log says a pose in it (initial pose, else the first recorded belief), in
    the odometry frame from a certain zero where not.

    Attributes:
        position_per_metre: standard deviation of position along each axis after 1 m, m; it grows
            with the square root of the distance.
        heading_per_metre: of the heading after 1 m, rad.
        heading_per_turn: of the heading after turning by 1 rad, rad.
    """

    position_per_metre: float = 0.03
    heading_per_metre: float = 0.02
    heading_per_turn: float = 0.05

    name: ClassVar[str] = "dead_reckoning"
    needs: ClassVar[frozenset[str]] = frozenset({"odometry"})
    settings: ClassVar[frozenset[str]] = MOVED | {PROCESS_NOISE}

    def told(self, scale: float) -> DeadReckoning:
        """The same one, told standard deviations of `scale` times these."""
        return DeadReckoning(
            scale * self.position_per_metre,
            scale * self.heading_per_metre,
            scale * self.heading_per_turn,
        )

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """One row per scan (per odometry sample without scans), NaN where odometry says nothing.

        The ledger's source `odometry` says how far each step between rows moved the belief. It has
        no residual: nothing was expected of a step, and nothing could be rejected.

        Raises:
            NotApplicableError: the log has no odometry.
        """
        told = self.told(float(np.sqrt(scales_of(view)[0])))
        odometry = need_odometry(view, self.name)
        scans = scan_set(view)
        t_ns = odometry.t_ns if scans is None else scans.t_ns
        T_odom_base = odometry.at(t_ns).xyyaw
        given = starts(view, t_ns, T_odom_base)
        frame, start = odometry.frame_id, _zero(T_odom_base)
        T_map_odom = np.zeros(3)
        if given and given[0].xyyaw is not None:
            frame, start = view.manifest.frames.map or "map", given[0]
            T_map_odom = se2.compose(given[0].xyyaw, se2.inverse(T_odom_base[start.row]))
        xyyaw = se2.compose(T_map_odom, T_odom_base)
        xyyaw[: start.row] = np.nan
        cov = np.full((len(t_ns), 3, 3), np.nan)
        known = np.isfinite(xyyaw).all(axis=1)
        if known.any():
            cov[known] = told._covariance(odometry, T_map_odom, t_ns[start.row], start, t_ns[known])
        child = view.manifest.frames.base or odometry.child_frame_id
        return Estimate(PoseTrack(frame, child, t_ns, xyyaw, cov), _steps(frame, t_ns, xyyaw))

    def _covariance(
        self,
        odometry: PoseTrack,
        T_map_odom: se2.Array,
        start_ns: int,
        start: Start,
        at_ns: np.ndarray,
    ) -> se2.Array:
        """(M, 3, 3) at times (M,): every error of heading turns all that is driven after it.

        The sum over steps of q_i (p - p_i)(p - p_i)', p_i where heading noise q_i struck, is
        expanded into running sums; positions count from the start, so that they stay small.
        """
        between = odometry.t_ns[(odometry.t_ns > start_ns) & (odometry.t_ns < at_ns[-1])]
        t = np.unique(np.concatenate([[start_ns], between, at_ns]))
        path = odometry.at(t)
        t, path = t[path.has_pose], path.take(path.has_pose)
        xyyaw = se2.compose(T_map_odom, path.xyyaw)
        xy = xyyaw[:, :2] - xyyaw[0, :2]
        step = np.diff(xyyaw, axis=0, prepend=xyyaw[:1])
        length, turn = np.hypot(step[:, 0], step[:, 1]), np.abs(se2.wrap_angle(step[:, 2]))
        q = self.heading_per_metre**2 * length + self.heading_per_turn**2 * turn
        lever = np.column_stack([-xy[:, 1], xy[:, 0]])  # d position / d heading
        s0, s1 = np.cumsum(q), np.cumsum(q[:, None] * lever, axis=0)
        s2 = np.cumsum(q[:, None, None] * lever[:, :, None] * lever[:, None, :], axis=0)
        cross = lever[:, :, None] * s1[:, None, :]
        P = np.zeros((len(t), 3, 3))
        P[:, :2, :2] = (
            s0[:, None, None] * lever[:, :, None] * lever[:, None, :]
            - (cross + np.swapaxes(cross, 1, 2))
            + s2
            + (self.position_per_metre**2 * np.cumsum(length))[:, None, None] * np.eye(2)
        )
        P[:, :2, 2] = P[:, 2, :2] = s0[:, None] * lever - s1
        P[:, 2, 2] = s0
        F = np.broadcast_to(np.eye(3), (len(t), 3, 3)).copy()
        F[:, :2, 2] = lever
        P += F @ start.cov @ np.swapaxes(F, 1, 2)
        P = (P + np.swapaxes(P, 1, 2)) / 2.0
        return np.asarray(P[np.searchsorted(t, at_ns)])


def _steps(frame: str, t_ns: np.ndarray, xyyaw: se2.Array) -> tuple[Innovations, ...]:
    """The ledger of poses (N, 3): a row for each that has a pose before it."""
    known = np.flatnonzero(np.isfinite(xyyaw).all(axis=1))
    if len(known) < 2:
        return ()
    moved = np.diff(xyyaw[known], axis=0)
    moved[:, 2] = se2.wrap_angle(moved[:, 2])
    n = len(moved)
    return (
        Innovations(
            "odometry",
            t_ns[known[1:]],
            np.full((n, 3), np.nan),
            np.full((n, 3, 3), np.nan),
            np.ones(n, dtype=bool),
            ("x m", "y m", "yaw rad"),
            frame,
            moved,
            is_predicted=False,
        ),
    )


def _zero(T_odom_base: se2.Array) -> Start:
    known = np.isfinite(T_odom_base).all(axis=1)
    return Start(int(np.argmax(known)), None, np.zeros((3, 3)))
