"""One sentence a shift lead understands: no jargon, numbers with units, seconds from the start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.products import Changes
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.judgement import (
    UNDECIDED,
    ConstantOffset,
    FailureMode,
    Interval,
    State,
    Stop,
)
from slamreplay.verdict.words import BECAUSE

#: Nobody reads more at the start of a shift; what does not fit is left to the page.
MOST_CHARACTERS = 200
_AMBIGUOUS = (
    "It cannot be told where the robot was: more than one place in the map explains the whole log "
    "equally well"
)
_UNSPOKEN = (
    "The map was right; whether the robot was lost cannot be told, for it did not record where it "
    "believed to be"
)


def summary(
    state: State,
    intervals: Sequence[Interval],
    mode: FailureMode,
    stops: Sequence[Stop],
    changes: Changes | None,
    offset: ConstantOffset | None,
    *,
    start_ns: int,
    has_belief: bool,
    reason: str | None,
    doubt: str | None = None,
) -> str:
    """The sentence, of at most `MOST_CHARACTERS`: clauses that do not fit are left out.

    Args:
        state: of the log.
        intervals: of the log.
        mode: how it began.
        stops: unplanned ones.
        changes: for the share of changed beams.
        offset: a constant offset between belief and map, where there is one.
        start_ns: the log's start; times in the sentence count from it.
        has_belief: whether a localizer spoke at all.
        reason: why nothing could be judged, where that is so.
        doubt: that so much of the map is contradicted that it may not be the robot's.
    """
    clauses = _clauses(
        state,
        intervals,
        # The cause gives way to the doubt: there is no room for both.
        FailureMode("none", None, ()) if doubt and state == "lost_and_map_changed" else mode,
        changes,
        offset,
        start_ns,
        has_belief=has_belief,
        reason=reason,
    )
    tells_of_map = state in ("map_changed", "lost_and_map_changed")
    if doubt is not None and tells_of_map:
        clauses.insert(1, doubt)
    if stops and state not in UNDECIDED:
        stopped = _stopped(stops, start_ns, has_belief=has_belief)
        clauses.insert(2 if doubt is not None and tells_of_map else 1, stopped)
    text = clauses[0]
    for clause in clauses[1:]:
        if len(text) + len(clause) + 3 <= MOST_CHARACTERS:
            text = f"{text}; {clause}"
    return f"{text}."


def _clauses(
    state: State,
    intervals: Sequence[Interval],
    mode: FailureMode,
    changes: Changes | None,
    offset: ConstantOffset | None,
    start_ns: int,
    *,
    has_belief: bool,
    reason: str | None,
) -> list[str]:
    """The answer first, then what else there is to say, the weightier before the lighter."""
    changed = _changed(intervals, start_ns)
    where = _where(changes)
    if state == "insufficient_data":
        text = f"It cannot be told whether the robot was lost: {reason or 'too little recorded'}"
        return [text]
    if state == "unobservable":
        return [_AMBIGUOUS]
    if offset is not None and offset.cause == "map":
        text = (
            "The map frame is off, the robot was not lost: all it believed is shifted by "
            f"{offset.text}"
        )
        return [text, *([changed, *where] if state == "map_changed" else [])]
    if state in ("lost", "lost_and_map_changed"):
        both = state == "lost_and_map_changed"
        text = "The robot was lost and the aisle had changed" if both else "The robot was lost"
        why = BECAUSE.get(mode.kind, "")
        same = offset is not None and offset.cause == "map_or_start"
        return [
            f"{text}{f', for {why}' if why else ''}: {_lost(intervals, start_ns)}",
            *(["a map shifted by that much would look the same"] if same else []),
            *([changed, *where] if both else []),
        ]
    if state == "map_changed":
        knew = (
            f"The robot knew where it was{_within(intervals)}"
            if has_belief
            else "Whether it was lost cannot be told without a belief"
        )
        return [f"{knew}, but the aisle had changed: {changed}", *where]
    if not has_belief:
        return [_UNSPOKEN]
    also = [mode.evidence[0]] if mode.kind in ("timing", "odometry_slip") and mode.evidence else []
    return [f"The robot knew where it was{_within(intervals)} and the map was right", *also]


def _lost(intervals: Sequence[Interval], start_ns: int) -> str:
    lost = [i for i in intervals if i.is_lost]
    total = sum(i.duration_ns for i in lost) / NS_PER_S
    metres = max((i.max_error_m or 0.0 for i in lost), default=0.0)
    radians = max((i.max_error_rad or 0.0 for i in lost), default=0.0)
    begin, end = ((t - start_ns) / NS_PER_S for t in (lost[0].start_ns, lost[-1].end_ns))
    far = f"{metres:.1f} m" if metres >= 0.5 else f"{np.degrees(radians):.0f} degrees"
    for_ = f" ({total:.0f} s in all)" if end - begin > total + 1.0 else ""
    return f"from {begin:.1f} to {end:.1f} s{for_} it was up to {far} from where it believed to be"


def _changed(intervals: Sequence[Interval], start_ns: int) -> str:
    changed = [i for i in intervals if i.is_changed]
    if not changed:
        return "what it saw contradicts the map"
    begin, end = ((t - start_ns) / NS_PER_S for t in (changed[0].start_ns, changed[-1].end_ns))
    return f"from {begin:.1f} to {end:.1f} s what it saw contradicts the map"


def _where(changes: Changes | None) -> list[str]:
    if changes is None or not changes.regions:
        return []
    region = max(changes.regions, key=lambda r: r.area_m2)
    x, y = (region.bbox_m[0] + region.bbox_m[2]) / 2, (region.bbox_m[1] + region.bbox_m[3]) / 2
    return [f"most of all at x {x:.1f} m, y {y:.1f} m"]


def _within(intervals: Sequence[Interval]) -> str:
    """How well it knew: typically, or but for the time it was lost; nothing where that misleads."""
    errors = [i.max_error_m for i in intervals if i.max_error_m is not None and not i.is_lost]
    lost = sum(i.duration_ns for i in intervals if i.is_lost) / NS_PER_S
    if lost >= 0.1:
        return f" but for {lost:.1f} s"
    # A moment too short to be lost may lie beyond the limit: that is no praise.
    close = bool(errors) and max(errors) <= 0.5
    return f" (to within {max(errors):.2f} m)" if close else ""


def _stopped(stops: Sequence[Stop], start_ns: int, *, has_belief: bool) -> str:
    first = stops[0]
    of_map = {"map_changed": "the map did not hold", "healthy": "the map held"}
    of_both = {
        "lost": "it was lost",
        "map_changed": "it was not lost",
        "lost_and_map_changed": "it was lost in a changed aisle",
        "healthy": "it was not lost",
    }
    was = (of_both if has_belief else of_map).get(first.state, "its state cannot be judged")
    more = "" if len(stops) == 1 else f", first of {len(stops)} stops"
    return f"when it stopped at {(first.t_ns - start_ns) / NS_PER_S:.1f} s {was}{more}"
