"""People who pass by the robot, and the beams that meet them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.scans import laser_mount
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2
from slamreplay.geometry.times import seconds_since
from slamreplay.perturb.beams import Beams

#: A person at the height of the scan.
RADIUS_M = 0.22
#: A walking pace.
_SLOW_M_S, _FAST_M_S = 0.7, 1.5
#: Somebody passes at this distance from the robot's middle, comes no nearer than the last of these
#: at any time, and walks so far before and after, m.
_BESIDE_M, _POLITE_M, _WAY_M = (0.8, 4.0), 0.6, 10.0


@dataclass(frozen=True, eq=False)
class Met:
    """Which beams of which scan point at whom, person by person.

    Attributes:
        start: (P,) index of the scan's first beam among all of the laser's.
        low: (P,) number of the first beam that points at them, within the scan.
        high: (P,) number of the last one.
        middle: (P,) the beam that points at their middle, with a fraction.
        step_rad: (P,) between beams.
        apart_m: (P,) from the laser to their middle.
    """

    start: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    middle: se2.Array
    step_rad: se2.Array
    apart_m: se2.Array


@dataclass(frozen=True, eq=False)
class Passers:
    """Draws people about a robot that drives.

    Attributes:
        beams: of the laser.
        scan: (N,) scans with odometry, in time order.
        t_s: (N,) s since the first of them.
        base: (N, 3) the robot in the odometry frame then.
        mount: (3,) the laser on the robot.
        first: (N,) bearing of the first beam about the robot's upright axis, rad.
        step: (N,) rad between beams, signed likewise.
        sees_m: (N,) how far the scan sees where it sees farthest.
        odometry: where the robot is between scans.
    """

    beams: Beams
    scan: NDArray[np.int64]
    t_s: se2.Array
    base: se2.Array
    mount: se2.Array
    first: se2.Array
    step: se2.Array
    sees_m: NDArray[np.float32]
    odometry: PoseTrack

    @classmethod
    def about(
        cls, view: BundleView, beams: Beams, free_to_m: NDArray[np.float32], name: str
    ) -> Passers:
        """Those about the robot of a view.

        Args:
            view: with scans and odometry.
            beams: of its scans.
            free_to_m: (M,) how far each beam sees, 0 where it says nothing.
            name: of the perturbation.

        Raises:
            NotApplicableError: the log has no odometry at its scans, so that nothing says where
                people are from one scan to the next.
        """
        odometry = odometry_track(view)
        table = beams.table
        scan = np.argsort(table.t_ns, kind="stable")
        scan = scan[table["angle_increment_rad"][scan] != 0.0]
        if odometry is not None:
            base = odometry.at(table.t_ns[scan]).xyyaw
            known = np.isfinite(base).all(axis=1)
            scan, base = scan[known], base[known]
        if odometry is None or not len(scan):
            raise NotApplicableError("the log has no odometry to place people by", where=name)
        mount, upside_down = laser_mount(view, str(table["frame_id"][0]))
        sign = -1.0 if upside_down else 1.0
        t_s = seconds_since(table.t_ns[scan], int(table.t_ns[scan[0]]))
        first, step = table["angle_min_rad"][scan], table["angle_increment_rad"][scan]
        sees_m = np.zeros(len(table), dtype=np.float32)
        some = beams.lengths > 0
        sees_m[some] = np.maximum.reduceat(free_to_m, _starts(beams.lengths)[some])
        sees_m = sees_m[scan]
        return cls(beams, scan, t_s, base, mount, sign * first, sign * step, sees_m, odometry)

    def draw(self, count: int, rng: np.random.Generator) -> Met:
        """The beams that point at this many more people; who would come too near stays away."""
        u = rng.random((count, 5))
        passes = (u[:, 0] * len(self.t_s)).astype(np.int64)
        beside = _BESIDE_M[0] + (_BESIDE_M[1] - _BESIDE_M[0]) * u[:, 1]
        place = self.base[passes, :2] + beside[:, None] * _unit(2.0 * np.pi * u[:, 2])
        speed = _SLOW_M_S + (_FAST_M_S - _SLOW_M_S) * u[:, 4]
        velocity = speed[:, None] * _unit(2.0 * np.pi * u[:, 3])
        begin = np.searchsorted(self.t_s, self.t_s[passes] - _WAY_M / speed)
        end = np.searchsorted(self.t_s, self.t_s[passes] + _WAY_M / speed, side="right")
        who = np.repeat(np.arange(count), end - begin)
        row = np.arange(len(who)) + np.repeat(begin - _starts(end - begin), end - begin)
        since_s = self.t_s[row] - self.t_s[passes[who]]
        where = place[who] + since_s[:, None] * velocity[who]
        rude = np.zeros(count, dtype=bool)
        rude[who[np.hypot(*(where - self.base[row, :2]).T) < _POLITE_M]] = True
        stays = ~rude[who]
        who, row, where = who[stays], row[stays], where[stays]
        off = self._from_laser(self.base[row], where)
        late_s = self.beams.table["time_increment_s"][self.scan[row]]
        if (late_s > 0.0).any():  # seen by beams that leave later than the first
            late_s = late_s * np.clip(self._beam_of(off, row), 0, self._last_beam(row))
            after = self.odometry.at(
                self.beams.table.t_ns[self.scan[row]] + (late_s * 1e9).astype(np.int64)
            ).xyyaw
            base = np.where(np.isfinite(after), after, self.base[row])
            off = self._from_laser(base, where + late_s[:, None] * velocity[who])
        return self._met(off, row)

    def _met(self, off: se2.Array, row: NDArray[np.int64]) -> Met:
        """Beams that point at discs whose middles lie off the laser by (P, 2) at scans (P,).

        Those who are behind everything that a scan sees are left out.
        """
        apart = np.maximum(np.hypot(off[:, 0], off[:, 1]), RADIUS_M)
        seen = apart - RADIUS_M < self.sees_m[row]
        apart, off, row = apart[seen], off[seen], row[seen]
        step = np.abs(self.step[row])
        middle, half = self._beam_of(off, row), np.arcsin(RADIUS_M / apart) / step
        # Somebody at the seam of a scan that goes all around is met by its first beams as well.
        seam = np.flatnonzero(middle + half >= 2.0 * np.pi / step)
        pair = np.concatenate([np.arange(len(row)), seam])
        middle = np.concatenate([middle, middle[seam] - 2.0 * np.pi / step[seam]])
        in_turn = np.argsort(pair, kind="stable")
        pair, middle = pair[in_turn], middle[in_turn]
        low = np.maximum(np.ceil(middle - half[pair]), 0.0).astype(np.int64)
        high = np.minimum(np.floor(middle + half[pair]), self._last_beam(row[pair]))
        start = _starts(self.beams.lengths)[self.scan[row[pair]]]
        return Met(start, low, high.astype(np.int64), middle, step[pair], apart[pair])

    def _from_laser(self, base: se2.Array, where: se2.Array) -> se2.Array:
        """Places (P, 2) of the odometry frame as the laser of a robot at (P, 3) sees them."""
        laser = se2.inverse(se2.compose(base, self.mount))
        return se2.transform_points(laser, where[:, None])[:, 0]

    def _beam_of(self, off: se2.Array, row: NDArray[np.int64]) -> se2.Array:
        """(P,) number of the beam that points at each place, with a fraction; from 0 on."""
        turn = (np.arctan2(off[:, 1], off[:, 0]) - self.first[row]) * np.sign(self.step[row])
        return np.mod(turn, 2.0 * np.pi) / np.abs(self.step[row])

    def _last_beam(self, row: NDArray[np.int64]) -> NDArray[np.int64]:
        return self.beams.lengths[self.scan[row]] - 1


def _unit(angle: se2.Array) -> se2.Array:
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _starts(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) where each of parts of these lengths (N,) begins, laid end to end."""
    return np.cumsum(lengths) - lengths
