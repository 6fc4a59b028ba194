"""Losses that began with a belief set or told wrongly.

Each question answers with the cause, how sure it is and the sentences that show it, or passes
on with None.
"""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict import causes_motion
from slamreplay.verdict.case import LASTING_NS, Answer, Case
from slamreplay.verdict.cloud import right_cloud_m
from slamreplay.verdict.fit_at import fits_at_belief
from slamreplay.verdict.judgement import Interval
from slamreplay.verdict.map_frame import LOOKALIKE

#: Lost this soon after the first belief is lost from the start.
START_NS = 3 * NS_PER_S
#: A pose told with this standard deviation, m, is known to an aisle at best; one within so many of
#: them was told honestly.
VAGUE_M, HONEST = 1.0, 3.0


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
    first = int(error.t_ns[error.spoken][0])
    if onset - first > START_NS and causes_motion.moved_otherwise(case, onset) is not None:
        return None  # nothing is known of its first moments, and something else of later ones
    at = int(np.clip(np.searchsorted(error.t_ns, onset), 0, len(error.t_ns) - 1))
    if case.is_made_by_delay(at):
        return None
    metres, radians = error.distance_m[at], error.heading_rad[at]
    beyond = max(metres / case.limits.position_m, radians / case.limits.yaw_rad)
    far = f"{metres:.2f} m and {np.degrees(radians):.0f} deg"
    vague = _told_vaguely(case, rows[0])
    if vague is not None:
        text = (
            f"the first pose was {far} off and told to within {vague:.1f} m: scans had to decide, "
            "and more than one place looked alike to them"
        )
        return "sensing_ambiguity", 0.6, [text]
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


def _told_vaguely(case: Case, row: int) -> float | None:
    """The standard deviation in m of a first pose that is as far off as it was told to be."""
    t, sigma = case.error.t_ns, case.sigma_belief_m
    near = (t >= t[row]) & (t <= t[row] + NS_PER_S) & np.isfinite(sigma)
    if not near.any():
        return None
    told = float(sigma[near].max())
    is_honest = case.error.distance_m[row] <= HONEST * told
    return told if told >= VAGUE_M and is_honest else None


def was_set(case: Case, onset: int) -> Answer | None:
    """Somebody set a pose, and it was a wrong one."""
    resets, error = case.resets(onset), case.error
    at = int(np.clip(np.searchsorted(error.t_ns, onset), 0, len(error.t_ns) - 1))
    if not len(resets) or case.is_made_by_delay(at):
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
