"""Unplanned stops: when, where, in which state, and what came first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S
from slamreplay.geometry.transforms import clean_frame
from slamreplay.verdict.goals import aborted, navigations, recoveries
from slamreplay.verdict.judgement import FailureMode, Interval, State, Stop
from slamreplay.verdict.motion import STOP_NS, Span, commanded, moved_by, protections, rests
from slamreplay.verdict.words import BECAUSE

#: A recovery this soon after the robot came to rest, or this shortly before, belongs to the stop.
RECOVERY_AFTER_NS, RECOVERY_BEFORE_NS = 10 * NS_PER_S, 3 * NS_PER_S
#: A plan whose end is farther than this had not been driven to its end.
ARRIVED_M = 0.5
#: Stops nearer to each other than this are one: recoveries stir the robot without freeing it.
SAME_PLACE_M = 0.5
#: What a safety device says this shortly before a stop made it; a goal aborted this near to it
#: belongs to it.
GUARD_NS, ABORTED_NS = 2 * NS_PER_S, 3 * NS_PER_S
#: Commands that asked for motion during this share of the stop's first seconds went unheeded.
UNHEEDED = 0.5


def stops(
    view: BundleView,
    belief: PoseTrack | None,
    where: PoseTrack | None,
    intervals: Sequence[Interval],
    mode: FailureMode | None = None,
) -> tuple[Stop, ...]:
    """Every stop before arrival, in time order.

    Args:
        view: the log.
        belief: base in map as believed.
        where: base in map as it was.
        intervals: the verdict's, for the state of the moment.
        mode: how the loss began, for the first cause.
    """
    track = moved_by(view, where if where is not None else belief)
    if track is None:
        return ()
    found: list[Stop] = []
    last: se2.Array | None = None
    for rest, reason in _unplanned(view, belief, track):
        here = se2.interpolate(track.t_ns, track.xyyaw, np.array([rest.start_ns]))[0]
        if last is not None and np.hypot(*(here - last)[:2]) < SAME_PLACE_M:
            continue
        last = here
        interval = _at(intervals, rest.start_ns)
        state: State = "insufficient_data" if interval is None else interval.state
        x, y = _place((where, belief), rest.start_ns)
        cause = _cause(intervals, interval, view.manifest.start_ns, reason, mode)
        found.append(Stop(rest.start_ns, x, y, state, cause))
    return tuple(found)


def stop_findings(found: Sequence[Stop], start_ns: int) -> tuple[Finding, ...]:
    """SR-ACT-002, one for each stop."""
    return tuple(
        Finding(
            "SR-ACT-002",
            "info",
            f"stopped at {(s.t_ns - start_ns) / NS_PER_S:.1f} s before arrival: {s.cause}",
            start_ns=s.t_ns,
            end_ns=s.t_ns,
        )
        for s in found
    )


def _unplanned(
    view: BundleView, belief: PoseTrack | None, track: PoseTrack
) -> list[tuple[Span, str]]:
    """Spans before arrival with the reason to think so, in time order."""
    found: dict[int, tuple[Span, str]] = {}
    # What is inferred from a stop is no witness of it.
    begun = [recovery for recovery in recoveries(view) if not recovery.inferred]
    for rest in rests(track, turning_counts=False):
        until = min(rest.end_ns, rest.start_ns + RECOVERY_AFTER_NS)
        for recovery in begun:
            if rest.start_ns - RECOVERY_BEFORE_NS <= recovery.t_ns <= until:
                found[rest.start_ns] = rest, f"the recovery '{recovery.name}' followed"
                break
    active = navigations(view)
    for rest in rests(track):
        if any(other.start_ns <= rest.start_ns < other.end_ns for other, _ in found.values()):
            continue
        reason = _reason(view, rest, belief, track, active)
        if reason is not None:
            found[rest.start_ns] = rest, reason
    return [found[t] for t in sorted(found)]


def _reason(
    view: BundleView,
    rest: Span,
    belief: PoseTrack | None,
    track: PoseTrack,
    active: Sequence[Span] | None,
) -> str | None:
    """Why a rest is no arrival; None where it may be one."""
    by = protections(view, rest.start_ns - GUARD_NS, rest.start_ns + NS_PER_S)
    if by is not None:
        return f"a protective stop: '{by}'"
    failed = [t for t in aborted(view) if abs(t - rest.start_ns) <= ABORTED_NS]
    if failed:
        return "its goal was aborted"
    told = commanded(view)
    if told is not None:
        t_ns, moving = told
        inside = (t_ns >= rest.start_ns + NS_PER_S // 2) & (t_ns < rest.end_ns)
        if inside.any() and moving[inside].mean() >= UNHEEDED:
            return "it was told to move on and did not: blocked, or its drive was off"
    halt = "" if told is None else "it was commanded to stop, and "
    if active is not None:
        goal = any(
            a.start_ns < rest.start_ns and rest.start_ns + STOP_NS < a.end_ns for a in active
        )
        return f"{halt}its goal was still active" if goal else None
    short = _short_of_goal_m(view, rest, belief, track)
    if short is not None and short > ARRIVED_M:
        return f"{halt}it was still {short:.1f} m short of the end of its plan"
    return None


def _short_of_goal_m(
    view: BundleView, rest: Span, belief: PoseTrack | None, track: PoseTrack
) -> float | None:
    plans = view.role("plan")
    if plans is None or not len(plans):
        return None
    plans = plans.sorted_by_time()
    row = int(np.searchsorted(plans.t_ns, rest.start_ns, side="right")) - 1
    while row >= 0 and len(plans["xyyaw"][row]) < 3:
        row -= 1  # planners publish an empty path when they give up
    if row < 0:
        return None
    goal = plans["xyyaw"][row].reshape(-1, 3)[-1]
    frame = clean_frame(str(plans["frame_id"][row]))
    for poses in (belief, track):
        if poses is not None and clean_frame(poses.frame_id) == frame:
            pose = poses.at(np.array([rest.start_ns])).xyyaw[0]
            if np.isfinite(pose).all():
                return float(np.hypot(*(goal - pose)[:2]))
    base = view.manifest.frames.base
    if base and view.transforms.has_path(frame, base):
        T, known = view.transforms.lookup(frame, base, np.array([rest.start_ns]))
        if known[0]:
            return float(np.hypot(*(goal - se3.planar(T)[0])[:2]))
    return None


def _at(intervals: Sequence[Interval], t_ns: int) -> Interval | None:
    return next((i for i in intervals if i.start_ns <= t_ns < i.end_ns), None)


def _place(tracks: Sequence[PoseTrack | None], t_ns: int) -> tuple[float | None, float | None]:
    for track in tracks:
        if track is not None:
            pose = track.at(np.array([t_ns])).xyyaw[0]
            if np.isfinite(pose).all():
                return float(pose[0]), float(pose[1])
    return None, None


def _cause(
    intervals: Sequence[Interval],
    interval: Interval | None,
    start_ns: int,
    reason: str,
    mode: FailureMode | None,
) -> str:
    """What came first: being lost or the changed map, else what the log says of the stop itself."""
    if interval is None or not (interval.is_lost or interval.is_changed):
        return reason
    parts = []
    if interval.is_lost:
        why = "" if mode is None else BECAUSE.get(mode.kind, "")
        parts.append((since(intervals, interval, lost=True), "it was lost", why))
    if interval.is_changed:
        text = "what it saw contradicted the map"
        parts.append((since(intervals, interval, lost=False), text, ""))
    words = [
        f"{text} since {(t - start_ns) / NS_PER_S:.1f} s{f' ({why})' if why else ''}"
        for t, text, why in sorted(parts)
    ]
    return f"{' and '.join(words)}; {reason}"


def since(intervals: Sequence[Interval], interval: Interval, *, lost: bool) -> int:
    """When the unbroken stretch of one answer began that an interval is part of, ns."""
    begun = interval.start_ns
    for other in reversed([i for i in intervals if i.end_ns <= interval.start_ns]):
        if other.end_ns != begun or not (other.is_lost if lost else other.is_changed):
            break
        begun = other.start_ns
    return begun
