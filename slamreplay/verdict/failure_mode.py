"""How it began: the first thing that went wrong before the robot was lost.

Three motions are laid beside each other over the half minute before the belief left the truth: the
odometry's, hindsight's and the belief's own. Who disagrees with whom names the culprit; where all
three agree, the clocks, the map and the belief's own covariance are asked. What can be shown by
nothing is called `none`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict import causes_motion, causes_pose, causes_scans
from slamreplay.verdict.case import LASTING_NS, Answer, Case
from slamreplay.verdict.intervals import episodes
from slamreplay.verdict.judgement import FailureMode, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.words import bold_words, changed_words

#: An episode counts before others if its error reached this many times the limit or it lasted.
CLEAR = 1.5


def failure_mode(case: Case) -> FailureMode:
    """The mode of a log, from its intervals and the motions around the loss that tells most."""
    worst = telling(case.intervals, case.limits)
    if worst is None:
        return _not_lost(case)
    onset = case.since_lost(worst)
    bold = bold_words(case.error, worst, case.sigma_belief_m, case.start_ns)
    gross = case.wheels is not None and case.wheels.is_gross
    questions: tuple[Callable[[], Answer | None], ...] = (
        lambda: causes_pose.told_otherwise(case, worst),
        lambda: causes_pose.from_the_start(case, worst, onset),
        lambda: causes_motion.moved_otherwise(case, onset),
        lambda: causes_pose.was_set(case, onset),
        lambda: causes_scans.blind(case, onset),
        lambda: causes_scans.late(case, onset),
        lambda: causes_scans.changed_map(case, onset),
        lambda: causes_motion.unheard(case, onset),
        lambda: causes_motion.uncalibrated(case, onset) if gross else None,
        lambda: causes_scans.pulled(case, worst, onset, causes_scans.JUMP_M if bold else 0.0),
        lambda: causes_motion.sure_of_itself(case, onset) if bold else None,
        lambda: causes_motion.uncalibrated(case, onset),
        lambda: causes_motion.drifted(case, worst, onset),
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
    late = delay is not None and delay.is_significant and abs(delay.seconds) >= causes_scans.DELAY_S
    words = (delay.text,) if delay is not None and late else ()
    if sum(i.duration_ns for i in changed) / NS_PER_S >= case.limits.total_s:
        told = changed_words(changed, case.hindsight, case.start_ns)
        return FailureMode("stale_map_use", 0.9, (*told, *words))
    if late:
        return FailureMode("timing", 0.8, words)
    if case.wheels is not None and case.wheels.is_gross:
        return FailureMode("odometry_slip", 0.6, case.wheels.calibration_words)
    return FailureMode("none", None, ())


def telling(intervals: Sequence[Interval], limits: Limits) -> Interval | None:
    """The first lost episode that is more than borderline, else the first one, if there is any."""
    lost = episodes(intervals, lambda i: i.is_lost)
    for i in lost:
        far = (i.max_error_m or 0.0) >= CLEAR * limits.position_m
        turned = (i.max_error_rad or 0.0) >= CLEAR * limits.yaw_rad
        if far or turned or i.duration_ns >= LASTING_NS:
            return i
    return lost[0] if lost else None
