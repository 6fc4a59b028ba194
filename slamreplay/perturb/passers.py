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
from slamreplay.geometry.discs import range_to_disc
from slamreplay.geometry.times import seconds_since
from slamreplay.perturb.beams import Beams

#: A person at the height of the scan, m, and a walking pace, m/s.
_RADIUS_M, _SLOW_M_S, _FAST_M_S = 0.22, 0.7, 1.5
#: Somebody passes at this distance from the robot's middle, comes no nearer than the last of these
#: at any time, and walks so far before and after, m.
_BESIDE_M, _POLITE_M, _WAY_M = (0.8, 4.0), 0.6, 10.0


@dataclass(frozen=True, eq=False)
class Met:
    """Beams that meet somebody; one that meets two occurs twice.

    Attributes:
        beam: (K,) index of the beam among all of the laser's.
        who: (K,) whom it meets, counted within the group.
        range_m: (K,) range to them.
    """

    beam: NDArray[np.int64]
    who: NDArray[np.int64]
    range_m: NDArray[np.float32]


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
        odometry: where the robot is between scans.
    """

    beams: Beams
    scan: NDArray[np.int64]
    t_s: se2.Array
    base: se2.Array
    mount: se2.Array
    first: se2.Array
    step: se2.Array
    odometry: PoseTrack

    @classmethod
    def about(cls, view: BundleView, beams: Beams, name: str) -> Passers:
        """Those about the robot of a view.

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
        return cls(beams, scan, t_s, base, mount, sign * first, sign * step, odometry)

    def draw(self, count: int, rng: np.random.Generator) -> Met:
        """The beams that meet this many more people; those who would come too near stay away."""
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
        return self._met(off, row, who)

    def _met(self, off: se2.Array, row: NDArray[np.int64], who: NDArray[np.int64]) -> Met:
        """Beams that meet discs whose middles lie off the laser by (P, 2) at scans (P,)."""
        far = np.maximum(np.hypot(off[:, 0], off[:, 1]), _RADIUS_M)
        step = np.abs(self.step[row])
        middle, half = self._beam_of(off, row), np.arcsin(_RADIUS_M / far) / step
        # Somebody at the seam of a scan that goes all around is met by its first beams as well.
        seam = np.flatnonzero(middle + half >= 2.0 * np.pi / step)
        pair = np.concatenate([np.arange(len(row)), seam])
        middle = np.concatenate([middle, middle[seam] - 2.0 * np.pi / step[seam]])
        half = half[pair]
        low = np.maximum(np.ceil(middle - half), 0.0).astype(np.int64)
        high = np.minimum(np.floor(middle + half), self._last_beam(row[pair])).astype(np.int64)
        lengths = np.maximum(high - low + 1, 0)
        number = np.arange(lengths.sum()) + np.repeat(low - _starts(lengths), lengths)
        turn = (number - np.repeat(middle, lengths)) * np.repeat(step[pair], lengths)
        ahead = np.repeat(far[pair], lengths)
        reach = range_to_disc(np.column_stack([ahead, np.zeros_like(ahead)]), turn, _RADIUS_M)
        scan = np.repeat(self.scan[row[pair]], lengths)
        beam = _starts(self.beams.lengths)[scan] + number
        return Met(beam, np.repeat(who[pair], lengths), reach.astype(np.float32))

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
