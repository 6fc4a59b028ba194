"""One sentence a shift lead understands: no jargon, numbers with units, seconds from the start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.products import Changes
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.judgement import FailureMode, Interval, State, Stop
from slamreplay.verdict.map_frame import ConstantOffset

_BECAUSE = {
    "wrong_initial_pose": "it was wrong from the first pose on",
    "odometry_slip": "its wheels slipped",
    "kidnapped": "it was moved without its wheels turning",
    "association_error": "it took one place for another",
    "stale_map_use": "it trusted a map that was no longer true",
    "overconfidence": "it was surer of itself than it had reason to be",
}


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
) -> str:
    """The sentence.

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
    """
    text = _what(state, intervals, mode, changes, offset, start_ns, has_belief, reason)
    if stops and state not in ("insufficient_data", "unobservable"):
        text += f"; {_stopped(stops, start_ns)}"
    return f"{text}."


def _what(
    state: State,
    intervals: Sequence[Interval],
    mode: FailureMode,
    changes: Changes | None,
    offset: ConstantOffset | None,
    start_ns: int,
    has_belief: bool,
    reason: str | None,
) -> str:
    if state == "insufficient_data":
        return (
            f"It cannot be told whether the robot was lost: {reason or 'too little was recorded'}"
        )
    if state == "unobservable":
        return (
            "It cannot be told where the robot was: more than one place in the map explains the "
            "whole log equally well"
        )
    if offset is not None and offset.cause == "map":
        text = (
            f"The map frame is off, the robot was not lost: everything it believed is shifted by "
            f"the same {offset.text}"
        )
        changed = _changed(intervals, changes, start_ns)
        return f"{text}; {changed}" if state == "map_changed" else text
    if state == "lost":
        return f"The robot was lost: {_lost(intervals, mode, offset, start_ns)}"
    if state == "map_changed":
        knew = (
            "The robot knew where it was"
            if has_belief
            else "Whether the robot was lost cannot be told without a belief"
        )
        return f"{knew}{_within(intervals)}, but {_changed(intervals, changes, start_ns)}"
    if state == "lost_and_map_changed":
        return (
            f"The robot was lost and the aisle had changed: "
            f"{_lost(intervals, mode, offset, start_ns)}; {_share(intervals, changes, start_ns)}"
        )
    if not has_belief:
        return (
            "The map was right; whether the robot was lost cannot be told, for it did not record "
            "where it believed to be"
        )
    return f"The robot knew where it was{_within(intervals)} and the map was right"


def _lost(
    intervals: Sequence[Interval],
    mode: FailureMode,
    offset: ConstantOffset | None,
    start_ns: int,
) -> str:
    lost = [i for i in intervals if i.is_lost]
    total = sum(i.duration_ns for i in lost) / NS_PER_S
    metres = max((i.max_error_m or 0.0 for i in lost), default=0.0)
    radians = max((i.max_error_rad or 0.0 for i in lost), default=0.0)
    begin, end = ((t - start_ns) / NS_PER_S for t in (lost[0].start_ns, lost[-1].end_ns))
    far = f"{metres:.1f} m" if metres >= 0.5 else f"{np.degrees(radians):.0f} degrees"
    text = f"from {begin:.1f} s to {end:.1f} s its belief was up to {far} off"
    if end - begin > total + 0.1:
        text += f", for {total:.1f} s in all"
    if mode.kind in _BECAUSE:
        text += f"; {_BECAUSE[mode.kind]}"
    if offset is not None and offset.cause == "map_or_start":
        text += f"; a map shifted by {offset.text} would look the same"
    return text


def _changed(intervals: Sequence[Interval], changes: Changes | None, start_ns: int) -> str:
    return f"the aisle had changed: {_share(intervals, changes, start_ns)}"


def _share(intervals: Sequence[Interval], changes: Changes | None, start_ns: int) -> str:
    changed = [i for i in intervals if i.is_changed]
    if not changed or changes is None:
        return "the world differed from the map"
    begin, end = ((t - start_ns) / NS_PER_S for t in (changed[0].start_ns, changed[-1].end_ns))
    share = changes.changed_share[np.isfinite(changes.changed_share)]
    most = 100.0 * float(share.max()) if len(share) else 0.0
    text = (
        f"from {begin:.1f} s to {end:.1f} s up to {most:.0f} % of what it saw contradicts the map"
    )
    if changes.regions:
        region = max(changes.regions, key=lambda r: r.area_m2)
        x, y = (region.bbox_m[0] + region.bbox_m[2]) / 2, (region.bbox_m[1] + region.bbox_m[3]) / 2
        text += f", most of all around x {x:.1f} m, y {y:.1f} m"
    return text


def _within(intervals: Sequence[Interval]) -> str:
    errors = [i.max_error_m for i in intervals if i.max_error_m is not None and not i.is_lost]
    lost = sum(i.duration_ns for i in intervals if i.is_lost) / NS_PER_S
    text = f" (to within {max(errors):.2f} m)" if errors else ""
    return f"{text} but for {lost:.1f} s" if lost else text


def _stopped(stops: Sequence[Stop], start_ns: int) -> str:
    first = stops[0]
    was = {
        "lost": "lost",
        "map_changed": "not lost, in a changed aisle",
        "lost_and_map_changed": "lost in a changed aisle",
        "healthy": "not lost",
    }.get(first.state, "in a state that cannot be judged")
    text = f"when it stopped at {(first.t_ns - start_ns) / NS_PER_S:.1f} s it was {was}"
    return text if len(stops) == 1 else f"{text} (the first of {len(stops)} unplanned stops)"
