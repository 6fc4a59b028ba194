"""Paths and their covariances, rounded to what an eye and a ruler can tell on the page.

Times are rounded to a tick (0.1 ms, longer in logs of more than two days), places to 1 mm and
headings to 0.01 deg; standard deviations keep 12 binary digits, which is 1/8192 of themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.report.replay.packing import short_floats

#: A payload's places are whole numbers of these.
PLACE_M, HEADING_RAD = 1e-3, float(np.radians(0.01))
_TICK_NS = 100_000
#: Rows of a path beyond this are left out evenly: more would not be told apart on a screen.
_MOST_ROWS = 24_000


@dataclass(frozen=True)
class Ticks:
    """The payload's clock: whole ticks since the log's start, in 31 bits."""

    start_ns: int
    tick_ns: int

    @classmethod
    def of(cls, start_ns: int, end_ns: int) -> Ticks:
        """As fine as 31 bits allow over the log, and not finer than 0.1 ms."""
        return cls(start_ns, max(_TICK_NS, -(-(end_ns - start_ns) // (2**31 - 1))))

    def at(self, t_ns: NDArray[np.int64]) -> NDArray[np.int32]:
        """Times in ticks, rounded; what lies beyond 31 bits ends there."""
        ticks = np.asarray(t_ns, dtype=np.int64) - self.start_ns + self.tick_ns // 2
        limit = 2**31 - 1
        return np.clip(ticks // self.tick_ns, -limit, limit).astype(np.int32)


def known(track: PoseTrack | None, from_ns: int) -> PoseTrack | None:
    """A track's poses in time order from a moment on; None without any."""
    if track is None:
        return None
    order = np.argsort(track.t_ns, kind="stable")
    track = track.take(order[track.t_ns[order] >= from_ns])
    return track if track.has_pose.any() else None


def packed_track(
    name: str, track: PoseTrack, ticks: Ticks, origin: se2.Array
) -> tuple[dict[str, NDArray], int]:
    """Arrays of one path by name, and of how many rows one was kept.

    `_t` (N,) ticks; `_pose` (3, N) x and y from `origin` in mm and heading in 0.01 deg; `_gap` (N,)
    1 where the rows before hold no pose; `_ellipse` (4, N) standard deviations along the long and
    the short axis, m, the long axis' bearing, rad, and that of the heading, rad, NaN where it has
    none. The last is left out where no row has a covariance.
    """
    has = track.has_pose
    rows = np.flatnonzero(has)
    every = max(1, -(-len(rows) // _MOST_ROWS))
    lost = np.cumsum(~has)[rows]
    gap = np.diff(lost[::every], prepend=lost[0]) > 0
    rows = rows[::every]
    place = np.round((track.xyyaw[rows, :2] - origin) / PLACE_M)
    heading = np.round(se2.wrap_angle(track.xyyaw[rows, 2]) / HEADING_RAD)
    pose = np.column_stack([np.clip(place, -(2**31) + 1, 2**31 - 1), heading]).T
    arrays: dict[str, NDArray] = {
        f"{name}_t": ticks.at(track.t_ns[rows]),
        f"{name}_pose": pose.astype(np.int32),
        f"{name}_gap": gap.astype(np.uint8),
    }
    ellipses = _ellipses(track.cov[rows])
    if np.isfinite(ellipses).any():
        arrays[f"{name}_ellipse"] = short_floats(ellipses)
    return arrays, every


def _ellipses(cov: se2.Array) -> se2.Array:
    """(4, N) of covariances (N, 3, 3); NaN where one is not finite or no covariance."""
    out = np.full((4, len(cov)), np.nan)
    plane = cov[:, :2, :2]
    sound = np.isfinite(plane).all(axis=(1, 2))
    variance, axis = np.linalg.eigh(plane[sound])
    with np.errstate(invalid="ignore"):
        out[0, sound], out[1, sound] = np.sqrt(variance[:, 1]), np.sqrt(variance[:, 0])
        out[3] = np.sqrt(cov[:, 2, 2])
    out[2, sound] = np.arctan2(axis[:, 1, 1], axis[:, 0, 1])
    out[:3, ~np.isfinite(out[:2]).all(axis=0)] = np.nan
    return out
