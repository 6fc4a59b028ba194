"""How logs found one area, one after the other, and what that advises."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.fleet.answers import Advice
from slamreplay.fleet.cells import AGAINST_M2, Ints
from slamreplay.fleet.counted import Flags
from slamreplay.geometry import se2

#: A log looked at an area if it saw so much of what others saw of it, and contradicts it with so
#: much of what the most contradicted: another side of a pallet is less than its front.
LOOK_SHARE, AGAINST_SHARE = 0.3, 0.2
#: Smaller areas are legs of a table: no reason to do anything.
LEAST_M2 = 0.1
#: To map again takes so many logs that contradict, of two robots where two have looked: a laser
#: that was knocked contradicts everything, but it is of one robot.
LEAST_LOGS, LEAST_ROBOTS = 3, 2
#: And so much of so many latest looks: four of five. Of changes that nine of ten looks see, each
#: for itself, 91 to 95 of 100 are then told as such from the fifth look on; of what is gone for two
#: looks (one of 50 errs) still 3 or 4.
RECENT, RECENT_SHARE = 5, 0.7
#: So many looks in a row that find the map right: what stood there is gone.
CLEARED = 2


@dataclass(frozen=True, eq=False)
class Course:
    """How the logs that looked at an area found it, one after the other.

    Attributes:
        log: (N,) in time, from the first that contradicts on.
        against: (N,) whether it contradicts.
        m2: median of what those contradict.
        looked: (M,) all logs that looked, before that, too.
    """

    log: Ints
    against: Flags
    m2: float
    looked: Ints


def course_of(log: Ints, sums: se2.Array) -> Course | None:
    """The course of an area; None where nothing of weight was ever contradicted.

    Args:
        log: (N,) logs that saw of it, in time.
        sums: (N, 2) what each saw of it, and what of that contradicts the map, m2.
    """
    seen, contradicted = sums.T
    against = contradicted >= max(AGAINST_M2, AGAINST_SHARE * float(contradicted.max()))
    is_look = against | (seen >= LOOK_SHARE * float(seen.max()))
    m2 = float(np.median(contradicted[against])) if against.any() else 0.0
    if m2 < LEAST_M2:
        return None
    log, against = log[is_look], against[is_look]
    first = int(np.argmax(against))
    return Course(log[first:], against[first:], m2, log)


def advice_on(
    logs: int, robots: int, looked: int, latest: int, recent: float
) -> tuple[Advice, str]:
    """What to do, and why in a sentence.

    Args:
        logs: that contradict it.
        robots: of these.
        looked: robots that looked.
        latest: as of `Area`.
        recent: share of the `RECENT` latest looks that contradict it.
    """
    if latest <= -CLEARED:
        return "temporary", f"the last {-latest} logs that looked found the map right again"
    if logs < LEAST_LOGS:
        return "watch", f"only {logs} {'log contradicts' if logs == 1 else 'logs contradict'} it"
    if robots < min(LEAST_ROBOTS, looked):
        return "watch", f"{looked} robots looked there, and only one found it so"
    if recent < RECENT_SHARE:
        return "watch", "it comes and goes, or has just gone"
    if latest < 0:  # one look may miss it, the next one tells
        return "re-map", f"{logs} logs contradict it, most of the latest among them"
    last = "one" if latest == 1 else str(latest)
    return "re-map", f"{logs} logs contradict it, the last {last} that looked among them"
