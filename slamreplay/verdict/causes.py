"""The questions that are put to a loss, one per cause; each answers or passes on with None.

An answer is the cause, how sure it is, and the sentences that show it.
"""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.case import Case
from slamreplay.verdict.cloud import right_cloud_m
from slamreplay.verdict.fit_at import fits_at_belief
from slamreplay.verdict.judgement import FailureKind, Interval
from slamreplay.verdict.partings import DISAGREE_M, Parting, parting
from slamreplay.verdict.scan_gaps import scan_gaps
from slamreplay.verdict.wheels import CARRIED_M, CARRIED_SHARE
from slamreplay.verdict.words import changed_words

#: Lost this soon after the first belief is lost from the start.
START_NS = 3 * NS_PER_S
#: An episode that lasts this long is more than a filter that settles.
LASTING_NS = 10 * NS_PER_S
#: A delay this long is named as what a log suffers from; one of a tenth of a second and more comes
#: before a wrong match, for it makes wrong matches.
DELAY_S = 0.1
#: Scans that score this part of what they do in the right place fit the wrong one as well.
ALIKE = 0.9
#: From this part on nothing told the robot that it stood elsewhere; see `map_frame.LOOKALIKE`.
LOOKALIKE = 0.5
#: A belief that was matched to a wrong place jumps there; one that only trusts itself slides.
JUMP_M = 0.2
#: An error that drifts is this much larger in the last quarter before the loss than in the first.
GROWN = 1.5
#: A gap in the scans this shortly before the loss has to do with it.
BLIND_NS = 3 * NS_PER_S
#: A change this shortly before the loss has to do with it.
CHANGED_BEFORE_NS = 10 * NS_PER_S

Answer = tuple[FailureKind, float | None, list[str]]


def told_otherwise(case: Case, lost: Interval) -> Answer | None:
    """The localizer thought right and sent something else to tf: none of the causes below."""
    error = case.error
    metres = right_cloud_m(case.view, error, case.limits, lost.start_ns, lost.end_ns)
    if metres is None:
        return None
    text = (
        f"its particles were right (typically {metres:.2f} m off) while the pose it gave to the "
        f"robot was up to {lost.max_error_m or 0.0:.2f} m off: look at how it fills map to odom"
    )
    return "none", None, [text]


def from_the_start(case: Case, lost: Interval, onset: int) -> Answer | None:
    """The first belief was wrong already."""
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
    elif len(case.resets(onset)):
        words.append("a pose was set at that time")
    inside = (error.t_ns >= lost.start_ns) & (error.t_ns < lost.end_ns) & error.off(case.limits)
    if lost.duration_ns >= LASTING_NS and fits_at_belief(
        case.view, error, inside & error.known, LOOKALIKE
    ):
        words.append("the place it believed to be in looks much like the one it was in")
    return "wrong_initial_pose", sure, words


def _moved_unseen(case: Case, onset: int) -> Answer | None:
    """Without odometry: the robot moved while the belief stood still."""
    error = case.error
    found = parting(error.t_ns, error.where, error.belief, error.known, onset)
    if found is None or found.moved_m < CARRIED_M:
        return None
    if found.other_m >= CARRIED_SHARE * found.moved_m:
        return None
    text = (
        f"from {case.seconds(found.start_ns)} on the robot moved {found.moved_m:.2f} m within "
        f"{(error.t_ns[found.end] - error.t_ns[found.start]) / NS_PER_S:.1f} s and the belief "
        f"{found.other_m:.2f} m: it was carried, or its localizer was silent"
    )
    return "kidnapped", 0.6, [text]


def was_set(case: Case, onset: int) -> Answer | None:
    """Somebody set a pose, and it was a wrong one."""
    resets, error = case.resets(onset), case.error
    if not len(resets):
        return None
    # What was right for a second after somebody set it went wrong by something else.
    after = error.known & (error.t_ns > resets[0]) & (error.t_ns <= resets[0] + NS_PER_S)
    if onset > resets[0] + NS_PER_S and after.any() and not error.off(case.limits)[after].any():
        return None
    text = (
        f"a pose was set at {case.seconds(int(resets[0]))} and the belief left the truth at "
        f"{case.seconds(onset)}"
    )
    return "wrong_initial_pose", 0.7, [text]


def moved_otherwise(case: Case, onset: int) -> Answer | None:
    """Hindsight against odometry: slip, or carried."""
    error, odom = case.error, case.odometry()
    if odom is None:
        return _moved_unseen(case, onset)
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


def blind(case: Case, onset: int) -> Answer | None:
    """The localizer had no scans to match."""
    low, high = onset - BLIND_NS, onset + BLIND_NS
    gaps = scan_gaps(case.view, low, high, recorded=case.recorded)
    if not gaps:
        return None
    words = [gap.text(case.start_ns) for gap in gaps]
    return "timing", 0.7, [*words, f"the belief left the truth at {case.seconds(onset)}"]


def late(case: Case, onset: int) -> Answer | None:
    """Scans and odometry tell different times."""
    delay = case.delay
    if delay is None or not delay.is_significant or abs(delay.seconds) < DELAY_S:
        return None
    sure = 0.7 if delay.late != "either" else 0.6
    return "timing", sure, [delay.text, f"the belief left the truth at {case.seconds(onset)}"]


def changed_map(case: Case, onset: int) -> Answer | None:
    """The map was no longer true where the belief left the truth."""
    near = [
        i
        for i in case.intervals
        if i.is_changed and i.start_ns <= onset + START_NS and i.end_ns >= onset - CHANGED_BEFORE_NS
    ]
    if not near:
        return None
    text = f"the belief left the truth at {case.seconds(onset)}, where the map was no longer true"
    return "stale_map_use", 0.6, [text, *changed_words(near, case.hindsight, case.start_ns)]


def pulled(case: Case, lost: Interval, onset: int, least_m: float) -> Answer | None:
    """The belief against odometry and hindsight: its scans drew it to a wrong place."""
    error, odom = case.error, case.odometry()
    if odom is None:
        return None
    found: Parting | None = parting(error.t_ns, error.belief, odom, error.known, onset)
    if found is None or found.metres < DISAGREE_M or found.jump_m < least_m:
        return None
    # A belief that leaves odometry to follow the robot is being corrected, not misled.
    if parting(error.t_ns, error.belief, error.where, error.known, onset) is None:
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


def uncalibrated(case: Case, onset: int) -> Answer | None:
    """Odometry is wrong all along, and the localizer did not take it out."""
    words = () if case.wheels is None else case.wheels.calibration_words
    if not words:
        return None
    text = f"the belief left the truth at {case.seconds(onset)} without a jump"
    return "odometry_slip", 0.6, [*words, text]


def sure_of_itself(case: Case, onset: int) -> Answer | None:
    """Small errors of odometry that an honest covariance would have let the scans take out."""
    if case.odometry() is None:
        return None  # a slip would look the same
    text = f"the belief left the truth at {case.seconds(onset)} without a jump, sure of itself"
    words = () if case.wheels is None else case.wheels.calibration_words
    return "overconfidence", 0.7, [text, *words]


def drifted(case: Case, lost: Interval, onset: int) -> Answer | None:
    """An error that grew all along, with nothing that pushed it."""
    error = case.error
    if case.odometry() is None:
        return None
    rows = np.flatnonzero(error.known & np.isfinite(error.distance_m) & (error.t_ns <= onset))
    if len(rows) < 10 or (error.t_ns[rows[-1]] - error.t_ns[rows[0]]) < LASTING_NS:
        return None
    beyond = np.maximum(
        error.distance_m / case.limits.position_m, error.heading_rad / case.limits.yaw_rad
    )[rows]
    early, late = (float(np.median(part)) for part in np.array_split(beyond, 4)[::3])
    if not late > GROWN * early:
        return None
    text = (
        f"the error grew to {lost.max_error_m or 0.0:.2f} m and "
        f"{np.degrees(lost.max_error_rad or 0.0):.0f} deg without a jump: small errors of its "
        "motion added up and nothing took them out"
    )
    return "optimization_drift", 0.5, [text]
