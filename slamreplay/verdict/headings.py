"""Headings over time, and the third one that tells whether scans or odometry are late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S, ns

#: Turn rates are differences of headings over this time.
_RATE_S = 0.16


@dataclass(frozen=True, eq=False)
class Heading:
    """A heading over time: (N,) sorted times, unwrapped rad."""

    t_ns: NDArray[np.int64]
    yaw: se2.Array

    def at(self, t_ns: NDArray[np.int64], late_s: float = 0.0) -> se2.Array:
        """Headings `late_s` before times (M,), NaN outside."""
        back = (t_ns - self.t_ns[0]) - ns(late_s)
        return np.asarray(np.interp(back, self.t_ns - self.t_ns[0], self.yaw, np.nan, np.nan))

    def rate(self, t_ns: NDArray[np.int64], late_s: float = 0.0) -> se2.Array:
        """Turn rates in rad/s, the same way."""
        half = _RATE_S / 2.0
        return (self.at(t_ns, late_s - half) - self.at(t_ns, late_s + half)) / _RATE_S


def third_witness(view: BundleView, wheels: Heading) -> tuple[str, Heading | None]:
    """A third heading over time: the IMU's, else the odometry topic's where tf was compared."""
    for name, found in (("IMU", _imu(view)), ("odometry topic", _topic(view))):
        if found is None or len(found.t_ns) < 3:
            continue
        told, own = found.at(wheels.t_ns), wheels.yaw
        both = np.isfinite(told)
        same = both.sum() > 2 and np.allclose(np.diff(told[both]), np.diff(own[both]), atol=1e-6)
        if both.mean() > 0.5 and not (same and name == "odometry topic"):
            return name, found
    return "", None


def _imu(view: BundleView) -> Heading | None:
    table = view.role("imu")
    if table is None or len(table) < 3:
        return None
    table = table.sorted_by_time()
    t, rate = table.t_ns, table["angular_velocity_xyz"]
    if not np.isfinite(rate).any():  # a heading that never turns would be no witness
        return None
    base, frame = view.manifest.frames.base, str(table["frame_id"][0])
    up = np.array([0.0, 0.0, 1.0])
    if base and view.transforms.has_path(base, frame):
        T, known = view.transforms.lookup(base, frame, t[len(t) // 2 : len(t) // 2 + 1])
        up = T[0, 2, :3] if known[0] else up
    about = np.nan_to_num(rate @ up)
    step = np.diff(t) / NS_PER_S
    yaw = np.concatenate([[0.0], np.cumsum(0.5 * (about[1:] + about[:-1]) * step)])
    return Heading(t, yaw)


def _topic(view: BundleView) -> Heading | None:
    table = view.role("odometry")
    if table is None or len(table) < 3:
        return None
    table = table.sorted_by_time()
    return Heading(table.t_ns, np.unwrap(se3.yaw_from_quaternion(table["orientation_xyzw"])))
