"""The turns that an inertial unit measured, between any times.

Accelerations are not taken in: a planar robot's are some tenths of m/s^2, and one degree by which
the floor or the unit is not level adds 0.17 m/s^2, 8 m after ten seconds. They only say which way
is up where tf does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.upright import upright_axis
from slamreplay.bundle.view import BundleView
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S

#: Between samples farther apart than this nobody knows how far the robot turned.
_GAP_NS = NS_PER_S // 4
#: Faster than any gyroscope of a robot measures, rad/s.
_ABSURD = 40.0


@dataclass(frozen=True, eq=False)
class Gyro:
    """Turns about the upright axis, summed up.

    Attributes:
        t_ns: (N,) times of the samples, strictly increasing.
        turn: (N,) rad since the first sample.
        rate: (N,) rad/s.
        noise: (N,) rad^2, what the stated white noise of the rates adds up to; NaN where the log
            states none.
        gaps: (N,) number of gaps before each sample.
    """

    t_ns: NDArray[np.int64]
    turn: se2.Array
    rate: se2.Array
    noise: se2.Array
    gaps: NDArray[np.int64]

    def between(self, t_ns: NDArray[np.int64], noise: Noise) -> tuple[se2.Array, se2.Array]:
        """Turns (E,) from each of the sorted times (E,) to the next, and their variances.

        The first is NaN, and so is one over a gap or beyond the samples. White noise of the rate,
        an error of its scale and one of its clock count; its bias does not.
        """
        t = t_ns - self.t_ns[0]
        own = self.t_ns - self.t_ns[0]
        turn, rate, told = (np.interp(t, own, v, np.nan, np.nan)
                            for v in (self.turn, self.rate, self.noise))  # fmt: skip
        low = np.clip(np.searchsorted(own, t, side="right") - 1, 0, len(own) - 1)
        high = np.clip(np.searchsorted(own, t, side="left"), 0, len(own) - 1)
        before, after = self.gaps[low], self.gaps[high]
        turn = np.diff(turn, prepend=np.nan)
        turn[1:][before[:-1] != after[1:]] = np.nan
        span = np.diff(t, prepend=t[:1]) / NS_PER_S
        white = np.diff(told, prepend=np.nan)
        white = np.where(np.isfinite(white), white, 0.0) + noise.gyro_per_root_s**2 * span
        scale = noise.gyro_per_turn**2 * np.abs(turn)
        clock = (noise.gyro_clock_s * np.diff(rate, prepend=np.nan)) ** 2
        return turn, white + scale + clock


def gyro_of(view: BundleView) -> Gyro | None:
    """The turns of the unit that plays the role of the IMU.

    From its rates; from its orientation where it has no rates and states that orientation with a
    covariance. None where it has neither, or where nothing says how it sits on the robot: neither
    tf nor a specific force of about 1 g.
    """
    table = view.role("imu")
    if table is None or len(table) < 2:
        return None
    table = table.sorted_by_time()
    keep = np.append(True, np.diff(table.t_ns) > 0)
    table = table.take(keep)
    up = upright_axis(view, table)
    if up is None:
        return None
    rate = table["angular_velocity_xyz"] @ up
    sound = np.isfinite(rate) & (np.abs(rate) < _ABSURD)
    if sound.sum() >= 2:
        return _of_rates(table.take(sound), rate[sound], up)
    return _of_orientation(table)


def _of_rates(table: Table, rate: se2.Array, up: se2.Array) -> Gyro:
    dt = np.diff(table.t_ns) / NS_PER_S
    turn = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * dt))
    stated = table["angular_velocity_covariance"].reshape(-1, 3, 3)
    variance = np.einsum("i,nij,j->n", up, np.nan_to_num(stated), up)
    variance = np.where(np.isfinite(stated).all(axis=(1, 2)), np.maximum(variance, 0.0), np.nan)
    noise = np.append(0.0, np.cumsum(variance[1:] * dt**2))
    return Gyro(table.t_ns, turn, rate, noise, _gaps(table.t_ns))


def _of_orientation(table: Table) -> Gyro | None:
    stated = np.isfinite(table["orientation_covariance"]).all(axis=1)
    table = table.take(stated & np.isfinite(table["orientation_xyzw"]).all(axis=1))
    if len(table) < 2:
        return None
    yaw = np.unwrap(se3.yaw_from_quaternion(table["orientation_xyzw"]))
    rate = np.gradient(yaw, (table.t_ns - table.t_ns[0]) / NS_PER_S)
    unknown = np.full(len(yaw), np.nan)
    return Gyro(table.t_ns, yaw - yaw[0], rate, unknown, _gaps(table.t_ns))


def _gaps(t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.append(0, np.cumsum(np.diff(t_ns) > _GAP_NS))
