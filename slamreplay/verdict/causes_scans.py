"""Losses by scans: missing, late, of a changed map, or matched to a wrong place.

Each question answers with the cause, how sure it is and the sentences that show it, or passes
on with None.
"""

from __future__ import annotations

from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.case import Answer, Case
from slamreplay.verdict.fit_at import fits_at_belief
from slamreplay.verdict.judgement import Interval
from slamreplay.verdict.partings import DISAGREE_M, Parting, parting
from slamreplay.verdict.scan_gaps import scan_gaps
from slamreplay.verdict.words import changed_words

#: A delay this long is named as what a log suffers from; one of a tenth of a second and more comes
#: before a wrong match, for it makes wrong matches.
DELAY_S = 0.1
#: Scans that score this part of what they do in the right place fit the wrong one as well.
ALIKE = 0.9
#: A belief that was matched to a wrong place jumps there; one that only trusts itself slides.
JUMP_M = 0.2
#: Right after the jump is so long.
SOON_NS = 5 * NS_PER_S
#: A gap in the scans this shortly before the loss has to do with it.
BLIND_NS = 3 * NS_PER_S
#: A change this shortly before or after the loss has to do with it.
CHANGED_BEFORE_NS, CHANGED_AFTER_NS = 10 * NS_PER_S, 3 * NS_PER_S


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
    near = near_change(case, onset)
    if not near:
        return None
    text = f"the belief left the truth at {case.seconds(onset)}, where the map was no longer true"
    return "stale_map_use", 0.6, [text, *changed_words(near, case.hindsight, case.start_ns)]


def near_change(case: Case, onset: int) -> list[Interval]:
    """The intervals around a time in which the map was contradicted."""
    return [
        i
        for i in case.intervals
        if i.is_changed
        and i.start_ns <= onset + CHANGED_AFTER_NS
        and i.end_ns >= onset - CHANGED_BEFORE_NS
    ]


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
    # A place that looks alike does so at once; later on the robot drives where it does not.
    soon = inside & (error.t_ns <= int(error.t_ns[found.end]) + SOON_NS)
    if any(fits_at_belief(case.view, error, r & error.known, ALIKE) for r in (inside, soon)):
        text = f"{moved}: its scans fit the map there as well as where it really was"
        return "sensing_ambiguity", 0.7, [text]
    return "association_error", 0.6, [f"{moved}: its scans were matched to the wrong place"]
