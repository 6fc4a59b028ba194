"""Motion as odometry, gyroscope and commands tell it, step by step: do units and hands agree?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, Times

#: Slower motions are all noise, rad/s and m/s; fewer steps beyond them say nothing.
_TURNING, _DRIVING, _FEWEST = 0.15, 0.1, 25
#: Longer steps bridge a gap, s: what was told last does not hold for them.
_LONGEST_S = 0.5


@dataclass(frozen=True)
class Ratio:
    """How two witnesses tell one motion.

    Attributes:
        one: whose motion is divided: odometry, gyroscope.
        other: whose it is divided by: gyroscope, command.
        what: turn, or way.
        ratio: median over the steps in which either moves.
        n: steps.
    """

    one: str
    other: str
    what: str
    ratio: float
    n: int


def motion_ratios(view: BundleView) -> tuple[Ratio, ...]:
    """Every pair of witnesses that moved long enough."""
    told, t_ns = _witnesses(view)
    pairs = (("odometry", "gyroscope", "turn"), ("odometry", "command", "turn"),
             ("gyroscope", "command", "turn"), ("odometry", "command", "way"))  # fmt: skip
    found = []
    for one, other, what in pairs:
        if (one, what) in told and (other, what) in told and len(t_ns):
            ratio = _ratio(told[one, what], told[other, what], what)
            found += [] if ratio is None else [Ratio(one, other, what, *ratio)]
    return tuple(found)


def _witnesses(view: BundleView) -> tuple[dict[tuple[str, str], se2.Array], Times]:
    """Rates (N,) by witness and kind of motion at the steps of odometry, and their times (N,)."""
    odometry = odometry_track(view)
    if odometry is None or len(odometry) < 2:
        return {}, np.empty(0, dtype=np.int64)
    t_ns, xyyaw = odometry.t_ns, odometry.xyyaw
    dt = np.diff(t_ns) / NS_PER_S
    good = (dt > 0.0) & (dt < _LONGEST_S)
    dt, mid = dt[good], (t_ns[:-1] + np.diff(t_ns) // 2)[good]
    step = np.diff(xyyaw, axis=0)[good]
    told = {
        ("odometry", "turn"): se2.wrap_angle(step[:, 2]) / dt,
        ("odometry", "way"): np.hypot(step[:, 0], step[:, 1]) / dt,
    }
    imu, command = view.role("imu"), view.role("command")
    up = None if imu is None or not len(imu) else _up(view, str(imu["frame_id"][0]))
    if imu is not None and up is not None:
        told["gyroscope", "turn"] = _at(imu, imu["angular_velocity_xyz"] @ up, mid)
    if command is not None and len(command):
        told["command", "turn"] = _at(command, command["angular_velocity_xyz"][:, 2], mid)
        way = np.hypot(*command["linear_velocity_xyz"][:, :2].T)
        told["command", "way"] = _at(command, way, mid)
    return told, mid


def _up(view: BundleView, frame: str) -> se2.Array | None:
    """The base's z axis (3,) in a frame; None where tf does not tell: it may hang upside down."""
    base = view.manifest.frames.base
    if base is None or frame == base:
        return np.array([0.0, 0.0, 1.0])
    if not view.transforms.has_path(base, frame):
        return None
    T, valid = view.transforms.lookup(base, frame, np.array([view.manifest.start_ns]))
    return np.asarray(T[0, 2, :3]) if valid[0] else None


def _at(table: Table, values: se2.Array, t_ns: Times) -> se2.Array:
    """Values (N,) of a table at times (M,), the last that was told; NaN where that is long ago."""
    order = np.argsort(table.t_ns, kind="stable")
    times, values = table.t_ns[order], values[order]
    row = np.searchsorted(times, t_ns, side="right") - 1
    fresh = (row >= 0) & (t_ns - times[np.maximum(row, 0)] < _LONGEST_S * NS_PER_S)
    return np.where(fresh, values[np.maximum(row, 0)], np.nan)


def _ratio(one: se2.Array, other: se2.Array, what: str) -> tuple[float, int] | None:
    """The median of one over other where the other moves, and of how many steps."""
    rows = np.isfinite(one) & np.isfinite(other)
    rows &= np.abs(other) > (_TURNING if what == "turn" else _DRIVING)
    if rows.sum() < _FEWEST:
        return None
    return float(np.median(one[rows] / other[rows])), int(rows.sum())
