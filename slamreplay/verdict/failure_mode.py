"""How it began: the first thing that went wrong before the robot was lost.

Three motions are laid beside each other over the half minute before the belief left the truth: the
odometry's, hindsight's and the belief's own. Who disagrees with whom names the culprit; where all
three agree, the clocks, the map and the belief's own covariance are asked. What can be shown by
nothing is called `none`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.belief_error import BeliefError
from slamreplay.verdict.fit_at import fits_at_belief
from slamreplay.verdict.intervals import episodes
from slamreplay.verdict.judgement import FailureKind, FailureMode, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.partings import DISAGREE_M, Parting, parting
from slamreplay.verdict.timing import Delay
from slamreplay.verdict.wheels import CARRIED_M, CARRIED_SHARE, Wheels
from slamreplay.verdict.words import bold_words, changed_words

#: Lost this soon after the first belief is lost from the start; a pose that somebody set this
#: shortly before is what made it so.
START_NS, RESET_NS = 3 * NS_PER_S, 5 * NS_PER_S
#: An episode counts before others if its error reached this many times the limit or it lasted.
CLEAR, LASTING_NS = 1.5, 10 * NS_PER_S
#: A delay this long is named as what a log suffers from; one of a tenth of a second and more comes
#: before a wrong match, for it makes wrong matches.
DELAY_S = 0.1
#: Scans that score this part of what they do in the right place fit the wrong one as well.
ALIKE = 0.9
#: A change this shortly before the loss has to do with it.
CHANGED_BEFORE_NS = 10 * NS_PER_S


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
    """

    view: BundleView
    error: BeliefError
    hindsight: Hindsight
    intervals: Sequence[Interval]
    sigma_belief_m: se2.Array
    limits: Limits
    delay: Delay | None = None
    wheels: Wheels | None = None

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


Answer = tuple[FailureKind, float | None, list[str]]


def failure_mode(case: Case) -> FailureMode:
    """The mode of a log, from its intervals and the motions around the loss that tells most."""
    lost = episodes(case.intervals, lambda i: i.is_lost)
    if not lost:
        return _not_lost(case)
    worst = _telling(lost, case.limits)
    onset = case.since_lost(worst)
    bold = bold_words(case.error, worst, case.sigma_belief_m, case.start_ns)
    questions: tuple[Callable[[], Answer | None], ...] = (
        lambda: _from_the_start(case, worst, onset),
        lambda: _moved_otherwise(case, onset),
        lambda: _was_set(case, onset),
        lambda: _late(case, onset),
        lambda: _changed_map(case, onset),
        lambda: _pulled(case, worst, onset),
        lambda: _uncalibrated(case, onset),
        lambda: _sure_of_itself(case, onset) if bold else None,
        lambda: _drifted(case, worst, onset),
    )
    for ask in questions:
        answer = ask()
        if answer is not None:
            kind, sure, words = answer
            return FailureMode(kind, sure, (*words, *bold))
    text = (
        f"the belief left the truth at {case.seconds(onset)}; none of the causes looked for can "
        "be shown"
    )
    return FailureMode("none", None, (text,))


def _not_lost(case: Case) -> FailureMode:
    changed = [i for i in case.intervals if i.is_changed]
    delay = case.delay
    late = delay is not None and delay.is_significant and abs(delay.seconds) >= DELAY_S
    words = (delay.text,) if delay is not None and late else ()
    if sum(i.duration_ns for i in changed) / NS_PER_S >= case.limits.total_s:
        told = changed_words(changed, case.hindsight, case.start_ns)
        return FailureMode("stale_map_use", 0.9, (*told, *words))
    return FailureMode("timing", 0.8, words) if late else FailureMode("none", None, ())


def _telling(lost: Sequence[Interval], limits: Limits) -> Interval:
    """The first episode that is more than borderline, else the first one."""
    for i in lost:
        far = (i.max_error_m or 0.0) >= CLEAR * limits.position_m
        turned = (i.max_error_rad or 0.0) >= CLEAR * limits.yaw_rad
        if far or turned or i.duration_ns >= LASTING_NS:
            return i
    return lost[0]


def _from_the_start(case: Case, lost: Interval, onset: int) -> Answer | None:
    error = case.error
    rows = np.flatnonzero(error.spoken & error.known & np.isfinite(error.distance_m))
    if not len(rows) or onset - int(error.t_ns[rows[0]]) > START_NS:
        return None
    at = int(np.clip(np.searchsorted(error.t_ns, onset), 0, len(error.t_ns) - 1))
    metres, radians = error.distance_m[at], error.heading_rad[at]
    beyond = max(metres / case.limits.position_m, radians / case.limits.yaw_rad)
    far = f"{metres:.2f} m and {np.degrees(radians):.0f} deg"
    words = [f"the first belief was already {far} from where the robot was"]
    # Just over the line for a moment is what a careful click and a filter that settles look like.
    sure = float(np.clip(0.4 + 0.5 * (beyond - 1.0), 0.4, 0.9))
    if sure < 0.65 and lost.duration_ns < LASTING_NS:
        words.append(
            f"that is just over the limit, and after {lost.duration_ns / NS_PER_S:.1f} s it was "
            "within it again"
        )
    elif len(_resets(case, onset)):
        words.append("a pose was set at that time")
    return "wrong_initial_pose", sure, words


def _resets(case: Case, onset: int) -> se2.Array:
    resets = case.view.table("initial_poses").t_ns
    return np.asarray(resets[(resets >= onset - RESET_NS) & (resets <= onset + NS_PER_S)])


def _was_set(case: Case, onset: int) -> Answer | None:
    resets = _resets(case, onset)
    if not len(resets):
        return None
    text = (
        f"a pose was set at {case.seconds(int(resets[0]))} and the belief left the truth at "
        f"{case.seconds(onset)}"
    )
    return "wrong_initial_pose", 0.7, [text]


def _odometry(case: Case) -> se2.Array | None:
    odometry = odometry_track(case.view)
    return None if odometry is None else odometry.at(case.error.t_ns).xyyaw


def _moved_otherwise(case: Case, onset: int) -> Answer | None:
    """Hindsight against odometry: slip, or carried."""
    error, odom = case.error, _odometry(case)
    if odom is None:
        return None
    found = parting(error.t_ns, error.where, odom, error.known, onset)
    if found is None:
        return None
    apart = f"{found.metres:.2f} m and {np.degrees(found.radians):.0f} deg"
    text = (
        f"from {case.seconds(found.start_ns)} on odometry and hindsight differ by {apart} within "
        f"{(error.t_ns[found.end] - error.t_ns[found.start]) / NS_PER_S:.1f} s: the robot moved "
        f"{found.moved_m:.2f} m, its wheels say {found.other_m:.2f} m"
    )
    words = [text]
    if case.wheels is not None:
        low, high = int(error.t_ns[found.start]), int(error.t_ns[found.end])
        over = [s for s in case.wheels.slips if s.start_ns <= high and s.end_ns >= low]
        words += [s.text(case.start_ns) for s in over]
    carried = found.moved_m >= CARRIED_M and found.other_m < CARRIED_SHARE * found.moved_m
    if carried or found.jump_m >= CARRIED_M:
        return "kidnapped", 0.8, words
    return "odometry_slip", 0.8, words


def _late(case: Case, onset: int) -> Answer | None:
    delay = case.delay
    if delay is None or not delay.is_significant or abs(delay.seconds) < DELAY_S:
        return None
    sure = 0.7 if delay.late != "either" else 0.6
    return "timing", sure, [delay.text, f"the belief left the truth at {case.seconds(onset)}"]


def _changed_map(case: Case, onset: int) -> Answer | None:
    near = [
        i
        for i in case.intervals
        if i.is_changed and i.start_ns <= onset + START_NS and i.end_ns >= onset - CHANGED_BEFORE_NS
    ]
    if not near:
        return None
    text = f"the belief left the truth at {case.seconds(onset)}, where the map was no longer true"
    return "stale_map_use", 0.6, [text, *changed_words(near, case.hindsight, case.start_ns)]


def _pulled(case: Case, lost: Interval, onset: int) -> Answer | None:
    """The belief against odometry: its scans drew it to a wrong place."""
    error, odom = case.error, _odometry(case)
    if odom is None:
        return None
    found: Parting | None = parting(error.t_ns, error.belief, odom, error.known, onset)
    if found is None or found.metres < DISAGREE_M:
        return None
    moved = (
        f"at {case.seconds(found.start_ns)} the belief moved by {found.metres:.2f} m otherwise "
        "than odometry and hindsight"
    )
    inside = (error.t_ns >= lost.start_ns) & (error.t_ns < lost.end_ns) & error.off(case.limits)
    if fits_at_belief(case.view, error, inside & error.known, ALIKE):
        text = f"{moved}: its scans fit the map there as well as where it really was"
        return "sensing_ambiguity", 0.7, [text]
    return "association_error", 0.6, [f"{moved}: its scans were matched to the wrong place"]


def _uncalibrated(case: Case, onset: int) -> Answer | None:
    words = () if case.wheels is None else case.wheels.calibration_words
    if not words:
        return None
    text = f"the belief left the truth at {case.seconds(onset)} without a jump"
    return "odometry_slip", 0.6, [*words, text]


def _sure_of_itself(case: Case, onset: int) -> Answer:
    text = (
        f"the belief left the truth at {case.seconds(onset)}; odometry and hindsight agree on the "
        "motion"
    )
    return "overconfidence", 0.6, [text]


def _drifted(case: Case, lost: Interval, onset: int) -> Answer | None:
    """An error that grew slowly, with nothing that pushed it."""
    error = case.error
    rows = np.flatnonzero(error.known & np.isfinite(error.distance_m) & (error.t_ns <= onset))
    rows = rows[error.t_ns[rows] >= onset - 3 * LASTING_NS]
    if len(rows) < 10 or (error.t_ns[rows[-1]] - error.t_ns[rows[0]]) < LASTING_NS:
        return None
    early, late = np.array_split(error.distance_m[rows], 3)[::2]
    if not np.median(late) > 1.5 * np.median(early):
        return None
    text = (
        f"the error grew from {np.median(early):.2f} m to {lost.max_error_m or 0.0:.2f} m without "
        "a jump: small errors of its motion added up and nothing took them out"
    )
    return "optimization_drift", 0.5, [text]
