"""People: discs at the height of the scan that walk to and fro."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.geometry import se2
from slamreplay.geometry.discs import range_to_disc

RADIUS_M = 0.22
#: Where somebody is who is not there.
_AWAY_M = -1e6


@dataclass(frozen=True)
class Walker:
    """Somebody who walks along waypoints and back again, without ever standing still.

    Attributes:
        waypoints: corners of the way, m.
        speed: m/s.
        offset_m: how far along the way they are at the start.
        radius_m: of the disc; larger for somebody who pushes a pallet.
    """

    waypoints: tuple[tuple[float, float], ...]
    speed: float = 1.1
    offset_m: float = 0.0
    radius_m: float = RADIUS_M

    def at(self, t_s: se2.Array) -> se2.Array:
        """(N, 2) positions at times (N,) since the start."""
        path = np.array(self.waypoints)
        arcs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        gone = (self.offset_m + self.speed * t_s) % (2.0 * arcs[-1])
        gone = np.where(gone > arcs[-1], 2.0 * arcs[-1] - gone, gone)
        return np.column_stack([np.interp(gone, arcs, path[:, i]) for i in (0, 1)])


@dataclass(frozen=True, eq=False, kw_only=True)
class Companion(Walker):
    """Somebody who keeps at one place beside the robot, in its own frame.

    Attributes:
        t_s: (N,) times of the robot's poses, in order.
        robot_xyyaw: (N, 3) where it was.
        beside_m: (2,) where they walk, in the robot's frame.
        stays_s: (from, to): before and after it they are far away.
    """

    t_s: se2.Array
    robot_xyyaw: se2.Array
    beside_m: tuple[float, float]
    stays_s: tuple[float, float]

    def at(self, t_s: se2.Array) -> se2.Array:
        """(N, 2) positions at times (N,) since the start."""
        xy = se2.compose(self.robot_xyyaw, np.array([*self.beside_m, 0.0]))[:, :2]
        found = np.column_stack([np.interp(t_s, self.t_s, xy[:, i]) for i in (0, 1)])
        found[(t_s < self.stays_s[0]) | (t_s > self.stays_s[1])] = _AWAY_M
        return found


def ranges_to(walkers: tuple[Walker, ...], t_s: se2.Array, rays: se2.Array) -> se2.Array:
    """(N,) range to the nearest person along each ray, inf where there is none.

    Args:
        walkers: the people.
        t_s: (N,) time of each ray since the start.
        rays: (N, 3) origin x y and direction of each ray in the map frame, m and rad.
    """
    nearest = np.full(len(t_s), np.inf)
    for walker in walkers:
        off = walker.at(t_s) - rays[:, :2]
        nearest = np.minimum(nearest, range_to_disc(off, rays[:, 2], walker.radius_m))
    return nearest
