"""What the log itself shows against hindsight: how much of each thing there is to put back."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.rootcause.incident import Incident
from slamreplay.rootcause.tracks import steps_of
from slamreplay.verdict.wheels import CARRIED_M, CARRIED_SHARE, Wheels

#: Odometry and hindsight are compared over this time.
STEP_NS = NS_PER_S // 2
#: What they may differ by, calibration apart: hindsight's own noise and a share of the motion.
NOISE_M, NOISE_RAD, SHARE, RAD_PER_M = 0.05, np.radians(2.0), 0.12, np.radians(2.0)
#: Stretches this near to each other are one; one of less in all is noise.
NEAR_NS, LEAST_M, LEAST_RAD = NS_PER_S, 0.2, np.radians(7.0)
#: A turn that wheels do not count, of a robot that hardly drives, is made by somebody; log odds of
#: what is clear.
_TURNED_RAD, _SURE = np.radians(25.0), 4.0


@dataclass(frozen=True)
class Slip:
    """Rows [first, last] between which odometry and hindsight moved otherwise.

    Attributes:
        metres: by how much the two differ over it.
        radians: the same in heading, hindsight minus odometry.
        moved_m: how far the robot got.
        counted_m: how far its wheels say.
    """

    first: int
    last: int
    metres: float
    radians: float
    moved_m: float
    counted_m: float

    @property
    def log_carried(self) -> float:
        """Log odds that somebody moved the robot, against wheels that slipped, from motion alone.

        Wheels that spin count more than the robot moves; one that is lifted or shoved moves more
        than its wheels count, or is turned where it stands.
        """
        more = self.moved_m - self.counted_m
        turned = abs(self.radians) / _TURNED_RAD
        if more >= CARRIED_M and self.counted_m < CARRIED_SHARE * self.moved_m:
            return _SURE
        if more >= 0.5 * CARRIED_M and more >= 0.25 * self.moved_m:
            return 0.5 * _SURE
        if turned >= 1.0 and self.counted_m < CARRIED_M:
            return 0.5 * _SURE
        return -_SURE if more < -CARRIED_M else -0.25 * _SURE


def calibrated(odometry: se2.Array, wheels: Wheels | None) -> se2.Array:
    """(N - 1, 3) odometry's steps without the errors that it has all along."""
    steps = steps_of(odometry)
    if wheels is None:
        return steps
    scale = _sure(wheels.scale, wheels.scale_sigma)
    turn = _sure(wheels.turn_scale, wheels.turn_sigma)
    pull = wheels.pull_rad_m or 0.0
    mended = steps / np.array([scale, scale, turn])
    mended[:, 2] -= pull * np.hypot(mended[:, 0], mended[:, 1])
    return mended


def _sure(value: float | None, sigma: float | None) -> float:
    if value is None or sigma is None or abs(value - 1.0) <= 2.0 * sigma:
        return 1.0
    return value


def slips_of(incident: Incident, steps: se2.Array) -> tuple[Slip, ...]:
    """Where the robot moved otherwise than its wheels say, calibration apart.

    Args:
        incident: its log.
        steps: (N - 1, 3) odometry's steps between rows.
    """
    rows = _knots(incident.t_ns, incident.known & np.isfinite(incident.where).all(axis=1))
    if len(rows) < 2 or not incident.has_odometry:
        return ()
    made = se2.between(incident.where[rows[:-1]], incident.where[rows[1:]])
    told = np.array([_over(steps, a, b) for a, b in pairwise(rows.tolist())])
    apart = se2.between(told, made)
    size = np.hypot(apart[:, 0], apart[:, 1])
    turned = np.abs(se2.wrap_angle(apart[:, 2]))
    way = np.maximum(np.hypot(*made[:, :2].T), np.hypot(*told[:, :2].T))
    turn = np.maximum(np.abs(made[:, 2]), np.abs(told[:, 2]))
    off = (size > NOISE_M + SHARE * np.minimum(way, np.hypot(*told[:, :2].T) + 0.1)) | (
        turned > NOISE_RAD + SHARE * np.minimum(turn, np.abs(told[:, 2]) + 0.1) + RAD_PER_M * way
    )
    found: list[list[int]] = []
    t = incident.t_ns
    for k in np.flatnonzero(off):
        a, b = int(rows[k]), int(rows[k + 1])
        if found and t[a] - t[found[-1][1]] <= NEAR_NS:
            found[-1][1] = b
        else:
            found.append([a, b])
    slips = []
    for a, b in found:
        one, other = se2.between(incident.where[a], incident.where[b]), _over(steps, a, b)
        rest = se2.between(other, one)
        metres, radians = float(np.hypot(rest[0], rest[1])), float(se2.wrap_angle(rest[2]))
        if metres >= LEAST_M or abs(radians) >= LEAST_RAD:
            way_m = float(np.hypot(steps[a:b, 0], steps[a:b, 1]).sum())
            moved = float(np.hypot(one[0], one[1]))
            slips.append(Slip(a, b, metres, radians, moved, way_m))
    return tuple(slips)


def _knots(t_ns: NDArray[np.int64], known: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Known rows about `STEP_NS` apart."""
    rows = np.flatnonzero(known)
    kept: list[int] = []
    for row in rows.tolist():
        if not kept or t_ns[row] - t_ns[kept[-1]] >= STEP_NS:
            kept.append(row)
    return np.array(kept, dtype=np.int64)


def _over(steps: se2.Array, first: int, last: int) -> se2.Array:
    """(3,) the motion that steps [first, last) make."""
    yaw = np.concatenate([[0.0], np.cumsum(steps[first:last, 2])])
    cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    dx, dy = steps[first:last, 0], steps[first:last, 1]
    return np.array([(cos * dx - sin * dy).sum(), (sin * dx + cos * dy).sum(), yaw[-1]])


def healed_steps(steps: se2.Array, slips: tuple[Slip, ...], truth: se2.Array) -> se2.Array:
    """(N - 1, 3) odometry's steps with hindsight's (N, 3) where it slipped, or told nothing."""
    out, made = steps.copy(), steps_of(truth)
    for slip in slips:
        out[slip.first : slip.last] = made[slip.first : slip.last]
    unknown = ~np.isfinite(out).all(axis=1)
    out[unknown] = made[unknown]
    return np.nan_to_num(out)
