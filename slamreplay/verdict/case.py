"""A log in which a cause is looked for: belief, hindsight and what was measured of its sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.verdict.belief_error import BeliefError
from slamreplay.verdict.judgement import FailureKind, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.timing import Delay
from slamreplay.verdict.wheels import Wheels

#: A pose that somebody set this shortly before the loss is what made it so.
RESET_NS = 5 * NS_PER_S
#: An episode that lasts this long is more than a filter that settles.
LASTING_NS = 10 * NS_PER_S

#: What a robot that drives among people does at most.
FASTEST_M_S, FASTEST_RAD_S = 1.5, 1.0
#: A cause, how sure it is (0 to 1, None where it is no cause), and the sentences that show it.
Answer = tuple[FailureKind, float | None, list[str]]


@dataclass(frozen=True, eq=False)
class Case:
    """What the cause is looked for in.

    Attributes:
        view: the log.
        error: belief against hindsight.
        hindsight: for the changed regions.
        intervals: the verdict's.
        sigma_belief_m: (N,) the belief's own standard deviation along its error, at the rows of
            `error`; NaN where it published none.
        limits: what counts as off.
        delay: between scans and odometry, None where it is not known.
        wheels: odometry against hindsight, None without odometry.
        recorded: whether the belief is the log's own, not that of an estimator run on it.
    """

    view: BundleView
    error: BeliefError
    hindsight: Hindsight
    intervals: Sequence[Interval]
    sigma_belief_m: se2.Array
    limits: Limits
    delay: Delay | None = None
    wheels: Wheels | None = None
    recorded: bool = True

    @property
    def start_ns(self) -> int:
        """The log's start: times in sentences count from it."""
        return self.view.manifest.start_ns

    def seconds(self, t_ns: int) -> str:
        """A time in words."""
        return f"{(t_ns - self.start_ns) / NS_PER_S:.1f} s"

    def since_lost(self, lost: Interval) -> int:
        """When the belief left the truth: the first scan beyond the limits in the episode."""
        error = self.error
        inside = (error.t_ns >= lost.start_ns) & (error.t_ns < lost.end_ns)
        inside &= error.off(self.limits)
        return int(error.t_ns[inside][0]) if inside.any() else lost.start_ns

    def odometry(self) -> se2.Array | None:
        """(N, 3) odometry at the rows of `error`, None where the log has none."""
        odometry = odometry_track(self.view)
        return None if odometry is None else odometry.at(self.error.t_ns).xyyaw

    def odometry_in_time(self) -> se2.Array | None:
        """(N, 3) odometry at the moments that the rows of `error` show, and to scale.

        Clocks and calibration are causes by themselves: what is left of a difference to where the
        robot was is something that happened to it.
        """
        odometry = odometry_track(self.view)
        if odometry is None:
            return None
        delay = self.delay
        late_ns = ns(delay.seconds) if delay is not None and delay.is_significant else 0
        told = odometry.at(self.error.t_ns - late_ns).xyyaw
        return told if self.wheels is None else self.wheels.mended(told)

    def is_made_by_delay(self, row: int) -> bool:
        """Whether a row's error is no larger than what a robot drives and turns within the delay.

        With clocks that disagree a right belief is off by that, and so is a wrong one at first.
        """
        delay = self.delay
        if delay is None or not delay.is_significant:
            return False
        late_s = abs(delay.seconds)
        near = self.error.distance_m[row] <= FASTEST_M_S * late_s
        return bool(near and self.error.heading_rad[row] <= FASTEST_RAD_S * late_s)

    def resets(self, onset: int) -> se2.Array:
        """Times of the poses that somebody set around the time at which the belief went wrong."""
        t_ns = self.view.table("initial_poses").t_ns
        return np.asarray(t_ns[(t_ns >= onset - RESET_NS) & (t_ns <= onset + NS_PER_S)])
