"""How far the robot has driven at each time, so that a seed can choose a moment on its way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import NS_PER_S, Times

#: Rates of turning are means over so long: single samples are too coarse to tell one.
_CELL_NS = NS_PER_S // 5
#: A step that is longer and faster than this was not driven: odometry was set back.
_JUMP_M, _JUMP_M_S = 0.5, 10.0


@dataclass(frozen=True, eq=False)
class Driven:
    """The way of the base by odometry.

    Attributes:
        t_ns: (N,) times, ascending.
        distance_m: (N,) driven since the first of them.
        yaw_rad: (N,) heading, without jumps of a whole turn.
    """

    t_ns: Times
    distance_m: Array
    yaw_rad: Array

    @property
    def length_m(self) -> float:
        """Driven in all."""
        return float(self.distance_m[-1])

    def distance_at(self, t_ns: Times) -> Array:
        """(M,) driven at times (M,); what lies outside the odometry is as at its ends."""
        return np.asarray(np.interp(t_ns - self.t_ns[0], self.t_ns - self.t_ns[0], self.distance_m))

    def yaw_in_turns_at(self, t_ns: Times, least_rad_s: float) -> Array:
        """(M,) rad by which it had turned until times (M,) while it turned faster than this."""
        own = self.t_ns - self.t_ns[0]
        edges = np.append(np.arange(0, own[-1], _CELL_NS), own[-1])
        turned = np.abs(np.diff(np.interp(edges, own, self.yaw_rad)))
        fast = np.append(turned > least_rad_s * np.diff(edges) / NS_PER_S, False)
        middle = own[:-1] + np.diff(own) // 2
        counts = fast[np.searchsorted(edges, middle, side="right") - 1]
        gathered = np.append(0.0, np.cumsum(np.diff(self.yaw_rad) * counts))
        return np.asarray(np.interp(t_ns - self.t_ns[0], own, gathered))


def driven(view: BundleView, name: str) -> Driven:
    """The way of the base.

    Args:
        view: the log.
        name: of the perturbation that asks.

    Raises:
        NotApplicableError: the log has no odometry.
    """
    track = odometry_track(view)
    if track is None or not track.has_pose.any():
        raise NotApplicableError("the log has no odometry to change", where=name)
    track = track.take(track.has_pose)
    step, dt = np.diff(track.xyyaw, axis=0), np.diff(track.t_ns) / NS_PER_S
    length = np.hypot(step[:, 0], step[:, 1])
    length[(length > _JUMP_M) & (length > _JUMP_M_S * dt)] = 0.0
    distance = np.append(0.0, np.cumsum(length))
    yaw = track.xyyaw[0, 2] + np.append(0.0, np.cumsum(se2.wrap_angle(step[:, 2])))
    return Driven(track.t_ns, distance, yaw)


def moment(way: Driven, length_m: float, rng: np.random.Generator, name: str) -> float:
    """Where on the way (m) a stretch of this length begins; a longer one contains a shorter one.

    Raises:
        NotApplicableError: the way is shorter.
    """
    spare = way.length_m - length_m
    if spare < 0.0:
        what = (
            f"the robot drives {way.length_m:.3g} m in this log, and {length_m:g} m are asked for"
        )
        raise NotApplicableError(what, where=name)
    return float(rng.random() * spare)
