"""Stretches without scans, in which a localizer had nothing to match.

A recorder drops scans too, and that harms nobody: a gap counts only where the localizer was silent
in it as well, that is, its correction of odometry stood still while the robot drove.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: A gap is this long and so many of the laser's own spacings: a short one of those seen, for where
#: most scans are lost the usual one is a gap itself.
GAP_NS, SPACINGS, OWN_SHARE = int(0.8 * NS_PER_S), 5, 0.1
#: A correction that moves by more than this in a gap was made by scans that were not recorded.
SILENT_M, SILENT_RAD = 0.02, np.radians(0.5)
#: Driving this far, or turning by this much, without a scan is what harms.
MOVED_M, MOVED_RAD = 0.3, np.radians(15.0)


@dataclass(frozen=True)
class ScanGap:
    """One gap (start_ns, end_ns) and the motion in it, as odometry tells it."""

    start_ns: int
    end_ns: int
    moved_m: float
    turned_rad: float

    def text(self, start_ns: int) -> str:
        """In words; times count from `start_ns`."""
        since = (self.start_ns - start_ns) / NS_PER_S
        ms = (self.end_ns - self.start_ns) / 1e6
        return (
            f"no scan came for {ms:.0f} ms from {since:.1f} s on, while the robot drove "
            f"{self.moved_m:.1f} m and turned {np.degrees(self.turned_rad):.0f} deg"
        )


def scan_gaps(
    view: BundleView, low_ns: int, high_ns: int, *, recorded: bool = True
) -> tuple[ScanGap, ...]:
    """Gaps that the localizer was silent in and the robot moved in, of those within two times.

    Args:
        view: the log; without odometry no gap can be told.
        low_ns: gaps that end before are left out.
        high_ns: so are those that end later.
        recorded: whether the belief asked about is the log's own; an estimator that ran on these
            scans alone was silent in every gap.
    """
    table, odometry = view.role("scan"), odometry_track(view)
    if table is None or len(table) < 3 or odometry is None or len(odometry) < 2:
        return ()
    t = np.sort(table.t_ns)
    apart = np.diff(t)
    rows = np.flatnonzero(apart >= max(GAP_NS, SPACINGS * int(np.quantile(apart, OWN_SHARE))))
    found = []
    for start, end in zip(t[rows].tolist(), t[rows + 1].tolist(), strict=True):
        if not low_ns <= end <= high_ns:
            continue
        # What the last scan taught arrives a moment after it; the next one's word is not yet in.
        inside = np.linspace(start + NS_PER_S // 4, end - 1, 8).astype(np.int64)
        path = odometry.at(inside).xyyaw
        if not np.isfinite(path).all() or (recorded and _spoke(view, inside, path)):
            continue
        if _reach(path, MOVED_M, MOVED_RAD) >= 1.0:
            way, turn = _most(odometry.at(np.array([start, *inside, end])).xyyaw)
            found.append(ScanGap(start, end, way, turn))
    return tuple(found)


def _spoke(view: BundleView, t_ns: NDArray[np.int64], odometry: se2.Array) -> bool:
    """Whether the log's belief moved against odometry (N, 3) at times (N,)."""
    belief = recorded_belief(view, t_ns)
    if belief is None or not belief.has_pose.all():
        return True
    correction = se2.compose(belief.xyyaw, se2.inverse(odometry))
    return _reach(correction, SILENT_M, SILENT_RAD) > 1.0


def _most(poses: se2.Array) -> tuple[float, float]:
    """How far poses (N, 3) get from the first one, in m and rad; NaN rows are left out."""
    poses = poses[np.isfinite(poses).all(axis=1)]
    step = se2.between(poses[0], poses)
    turned = np.abs(se2.wrap_angle(step[:, 2]))
    return float(np.hypot(step[:, 0], step[:, 1]).max()), float(turned.max())


def _reach(poses: se2.Array, metres: float, radians: float) -> float:
    way, turn = _most(poses)
    return max(way / metres, turn / radians)
