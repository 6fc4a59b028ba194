"""Losses by motion: the wheels, a carry, a covariance too small for them, drift.

Each question answers with the cause, how sure it is and the sentences that show it, or passes
on with None.
"""

from __future__ import annotations

import numpy as np

from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.case import LASTING_NS, Answer, Case
from slamreplay.verdict.judgement import Interval
from slamreplay.verdict.partings import Parting, parting
from slamreplay.verdict.wheels import CARRIED_M, CARRIED_SHARE

#: An error that drifts is this much larger in the last quarter before the loss than in the first.
GROWN = 1.5
#: Wheels that slip move the robot less than they turn. One that moved by this much farther than
#: they say, and by this share of its way, or turned this much more on the spot, was pushed.
PUSHED_M, PUSHED_SHARE, PUSHED_RAD, STOOD_M = 0.3, 0.25, np.radians(12.0), 0.25
#: A covariance that is to shrink by scans stays above this part of its first value where none is
#: taken in, and grows by so much; asked so long after the loss began, of so many scans.
KEPT, SPREAD, AFTER_NS, FEWEST_SCANS = 0.7, 1.5, 15 * NS_PER_S, 20


def moved_otherwise(case: Case, onset: int) -> Answer | None:
    """Hindsight against odometry: slip, or carried."""
    error, odom = case.error, case.odometry_in_time()
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
    if _is_pushed(error.where, odom, found):
        words.append("it moved more than its wheels did, as no slip makes it: it was pushed")
        return "kidnapped", 0.7, words
    return "odometry_slip", 0.8, words


def _is_pushed(where: se2.Array, odometry: se2.Array, found: Parting) -> bool:
    """Whether the robot moved more than its wheels: on the spot by a turn, else by its way."""
    more_m = found.moved_m - found.other_m
    if more_m >= max(PUSHED_M, PUSHED_SHARE * found.moved_m):
        return True
    turns = [
        float(
            np.abs(np.unwrap(track[found.start : found.end + 1, 2]) - track[found.start, 2]).max()
        )
        for track in (where, odometry)
        if np.isfinite(track[found.start : found.end + 1, 2]).all()
    ]
    stood = max(found.moved_m, found.other_m) < STOOD_M
    return stood and len(turns) == 2 and turns[0] - turns[1] >= PUSHED_RAD


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


def unheard(case: Case, onset: int) -> Answer | None:
    """The localizer's covariance only grew: it took nothing from scans that fit the map."""
    error, sigma = case.error, case.sigma_belief_m
    rows = np.flatnonzero(
        error.spoken & np.isfinite(sigma) & (sigma > 0.0) & (error.t_ns <= onset + AFTER_NS)
    )
    if len(rows) < FEWEST_SCANS or not error.known[rows].mean() > 0.8:
        return None
    first, last = (float(np.median(part)) for part in np.array_split(sigma[rows], 8)[::7])
    if sigma[rows].min() < KEPT * first or last < max(SPREAD * first, case.limits.position_m):
        return None
    text = (
        f"its own sigma grew from {first:.2f} m to {last:.2f} m while {len(rows)} scans came that "
        "fit the map where it was: none of them was taken in, and small errors of its motion "
        "added up"
    )
    return "optimization_drift", 0.7, [text]


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
