"""What went wrong: when, and the stretch of the log around it that causes are looked for in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.verdict.case import Case
from slamreplay.verdict.failure_mode import telling
from slamreplay.verdict.judgement import Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.scan_gaps import GAP_NS, OWN_SHARE, SPACINGS

#: Causes are looked for so long before the belief left the truth, and what they do so long after.
BEFORE_NS, AFTER_NS = 45 * NS_PER_S, 12 * NS_PER_S


@dataclass(frozen=True, eq=False)
class Incident:
    """A loss, and the log around it: one row per scan, and rows where scans are missing.

    Attributes:
        case: the verdict's: the log, belief against hindsight, delay and wheels.
        lost: the episode.
        onset_ns: when the belief left the truth.
        t_ns: (N,) stamps of the scans in the stretch, and of those that should have come.
        missing: (N,) rows of the latter.
        where: (N, 3) hindsight, NaN where it does not know.
        belief: (N, 3) what the robot believed, NaN before its first word.
        cov: (N, 3, 3) the covariance it published, NaN without one.
        odometry: (N, 3) base in odom when the scans were really taken; NaN where there is none.
        known: (N,) rows at which hindsight can be trusted.
        from_start: whether the stretch begins with the belief's first word.
    """

    case: Case
    lost: Interval
    onset_ns: int
    t_ns: NDArray[np.int64]
    missing: NDArray[np.bool_]
    where: se2.Array
    belief: se2.Array
    cov: se2.Array
    odometry: se2.Array
    known: NDArray[np.bool_]
    from_start: bool

    @property
    def view(self) -> BundleView:
        """The log."""
        return self.case.view

    @property
    def has_odometry(self) -> bool:
        """Whether there is enough of it for what it did to be put back."""
        return bool(np.isfinite(self.odometry).all(axis=1).mean() > 0.5)

    def row_at(self, t_ns: int) -> int:
        """The first row at or after a time; the last one beyond the end."""
        return min(int(np.searchsorted(self.t_ns, t_ns)), len(self.t_ns) - 1)


def incident_of(case: Case, belief: PoseTrack, limits: Limits) -> Incident | None:
    """The loss of a log that tells most; None where it was never lost.

    Args:
        case: intervals, belief and hindsight of the log.
        belief: as published, for its covariance.
        limits: what counts as off.
    """
    lost = telling(case.intervals, limits)
    if lost is None:
        return None
    error = case.error
    onset = case.since_lost(lost)
    spoken = np.flatnonzero(error.spoken & np.isfinite(error.belief).all(axis=1))
    if not len(spoken):
        return None
    first = int(error.t_ns[spoken[0]])
    low, high = max(first, onset - BEFORE_NS), onset + AFTER_NS
    rows = np.flatnonzero((error.t_ns >= low) & (error.t_ns <= high))
    if len(rows) < 10:
        return None
    came = error.t_ns[rows]
    t_ns = np.concatenate([came, _never_came(came)])
    order = np.argsort(t_ns, kind="stable")
    at = np.append(rows, np.full(len(t_ns) - len(rows), -1))[order]
    t_ns = t_ns[order]
    missing = at < 0
    odometry = odometry_track(case.view)
    delay = case.delay
    late_ns = 0 if delay is None or not delay.is_significant else ns(delay.seconds)
    odom = np.full((len(t_ns), 3), np.nan)
    if odometry is not None:
        odom = odometry.at(t_ns - late_ns).xyyaw
    known = error.known[at] & ~missing
    return Incident(
        case,
        lost,
        onset,
        t_ns,
        missing,
        np.where(known[:, None], error.where[at], np.nan),
        np.where(missing[:, None], np.nan, error.belief[at]),
        belief.at(t_ns).cov,
        odom,
        known,
        from_start=low == first,
    )


def _never_came(t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Stamps that scans would have had in the gaps between those (N,) that came."""
    apart = np.diff(t_ns)
    usual = max(int(np.quantile(apart, OWN_SHARE)), 1)
    gaps = np.flatnonzero(apart >= max(GAP_NS, SPACINGS * usual))
    stamps = [t_ns[k] + np.arange(usual, apart[k] - usual // 2, usual) for k in gaps]
    return np.concatenate(stamps) if stamps else np.zeros(0, dtype=np.int64)
