"""Whether the room a robot had would still do if its pose came later.

The gate lets a motion pass where 3 sigma fit into the clearance. A pose that is old adds what the
robot moved in the meantime, towards the nearest obstacle: 3 sigma and that must fit together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, Times
from slamreplay.verdict.actions import PLANNED_NS, room_at
from slamreplay.verdict.clearance import Obstacles
from slamreplay.verdict.latency.stages import Lag, Reach, towards
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.motion import motion_starts
from slamreplay.verdict.paths import AHEAD_NS, Paths

#: Under way the gate is asked this often.
EVERY_NS = NS_PER_S


@dataclass(frozen=True, eq=False)
class Rooms:
    """N moments at which sigma and clearance are known.

    Attributes:
        t_ns: (N,) when, on the bundle's clock.
        until_ns: (N,) the motion that is judged lasts until then.
        begins: (N,) whether a motion begins there; else it is under way.
        sigma_m: (N,) towards the nearest obstacle along the path.
        clearance_m: (N,) from the footprint's edge to it.
        direction_xy: (N, 2) unit vector to it, in the robot's frame.
        unknown: moments at which sigma or clearance is not known.
    """

    t_ns: Times
    until_ns: Times
    begins: NDArray[np.bool_]
    sigma_m: se2.Array
    clearance_m: se2.Array
    direction_xy: se2.Array
    unknown: int

    def __len__(self) -> int:
        return len(self.t_ns)

    def allowed(self, lag_m: se2.Array | float, sigmas: float) -> NDArray[np.bool_]:
        """(N,) whether `sigmas` standard deviations and a lag (N,) fit into the clearance."""
        needed = sigmas * self.sigma_m + lag_m
        return np.asarray((self.clearance_m > 0.0) & (needed <= self.clearance_m))

    def lags(self, lag: Lag, reach: Reach) -> tuple[se2.Array, se2.Array]:
        """(N,) the greatest lag towards the obstacle while each lasts: held, and carried.

        0 where the pose was not used in that time: nobody acted on it.
        """
        used = lag.ages.consumer.t_ns
        wrong = lag.miscounted_m(reach)
        held, carried = np.zeros(len(self)), np.zeros(len(self))
        for k in range(len(self)):
            rows = slice(*np.searchsorted(used, [self.t_ns[k], self.until_ns[k]]).tolist())
            u = self.direction_xy[k]
            held[k] = _most(towards(lag.held[rows], u, reach.lever_m))
            carried[k] = _most(towards(lag.carried[rows], u, reach.lever_m) + wrong[rows])
        return held, carried


def rooms(
    view: BundleView, belief: PoseTrack | None, limits: Limits, used_ns: Times
) -> Rooms | None:
    """The room of every motion that begins, and of each second under way; None without a belief.

    Args:
        view: the log.
        belief: base in map with its covariance, sorted by time.
        limits: of the gate.
        used_ns: (M,) when the pose was used while the robot moved, sorted.
    """
    if belief is None or not belief.has_pose.any():
        return None
    plan = view.role("plan")
    plans = np.zeros(0, dtype=np.int64) if plan is None else np.sort(plan.t_ns)
    begun = motion_starts(view, belief)
    seconds = used_ns // EVERY_NS
    under_way = used_ns[np.append(True, seconds[1:] != seconds[:-1])] if len(used_ns) else used_ns
    moments = sorted({(t, t + AHEAD_NS, True) for t in begun}
                     | {(t, t + EVERY_NS, False) for t in under_way.tolist()})  # fmt: skip
    obstacles, paths = Obstacles(view, belief, limits.footprint_radius_m), Paths(view, belief)
    yaws = _yaw(belief, np.array([t for t, _, _ in moments], dtype=np.int64))
    found: list[tuple[int, int, bool, float, float, float, float]] = []
    for (t, until, begins), yaw in zip(moments, yaws.tolist(), strict=True):
        row = int(np.searchsorted(plans, t, side="right")) - 1
        planned = begins and row >= 0 and t - int(plans[row]) <= PLANNED_NS
        sigma, room = room_at(t, belief, obstacles, paths.ahead(t, planned=planned))
        if sigma is None or room is None or not np.isfinite(yaw):
            continue
        x, y = room.direction_xy
        length = max(float(np.hypot(x, y)), 1e-9)
        cos, sin = np.cos(yaw), np.sin(yaw)
        u = ((cos * x + sin * y) / length, (cos * y - sin * x) / length)
        found.append((t, until, begins, sigma, room.metres, *u))
    columns = list(zip(*found, strict=True)) if found else [()] * 7
    return Rooms(
        np.array(columns[0], dtype=np.int64),
        np.array(columns[1], dtype=np.int64),
        np.array(columns[2], dtype=bool),
        np.array(columns[3], dtype=np.float64),
        np.array(columns[4], dtype=np.float64),
        np.array(columns[5:], dtype=np.float64).reshape(2, -1).T,
        len(moments) - len(found),
    )


def _yaw(belief: PoseTrack, t_ns: Times) -> se2.Array:
    """(N,) heading as it was last believed at times (N,), NaN before the first belief."""
    known = belief.take(belief.has_pose)
    rows = np.searchsorted(known.t_ns, t_ns, side="right") - 1
    return np.where(rows >= 0, known.xyyaw[np.maximum(rows, 0), 2], np.nan)


def _most(lag_m: se2.Array) -> float:
    known = lag_m[np.isfinite(lag_m)]
    return float(known.max()) if len(known) else 0.0
