"""Two questions, lost and changed, tiled into intervals of one state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

from slamreplay.verdict.judgement import UNDECIDED, Interval, State
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.timeline import BAD, UNKNOWN, Timeline

NS_PER_S = 1e9


def state_of(lost: int, changed: int) -> State:
    """The state of a moment. A question that is answered with yes stands, whatever the other one.

    Where neither is, one that cannot be answered makes the moment one that cannot be judged.
    """
    if lost == BAD:
        return "lost_and_map_changed" if changed == BAD else "lost"
    if changed == BAD:
        return "map_changed"
    return "insufficient_data" if UNKNOWN in (lost, changed) else "healthy"


def tiled(lost: Timeline, changed: Timeline) -> tuple[Interval, ...]:
    """Intervals over two timelines of the same span: each starts where the last one ended."""
    edges = sorted({s.start_ns for s in (*lost, *changed)} | {s.end_ns for s in (*lost, *changed)})
    out: list[Interval] = []
    for start, end in pairwise(edges):
        state = state_of(_value(lost, start), _value(changed, start))
        if out and out[-1].state == state:
            start = out.pop().start_ns
        out.append(Interval(state, start, end))
    return tuple(out)


def log_state(intervals: Sequence[Interval], limits: Limits) -> State:
    """The state of the whole log from the total times of its intervals."""
    lost = sum(i.duration_ns for i in intervals if i.is_lost) / NS_PER_S
    changed = sum(i.duration_ns for i in intervals if i.is_changed) / NS_PER_S
    whole = sum(i.duration_ns for i in intervals)
    if lost >= limits.total_s and changed >= limits.total_s:
        return "lost_and_map_changed"
    if lost >= limits.total_s:
        return "lost"
    if changed >= limits.total_s:
        return "map_changed"
    unobservable = sum(i.duration_ns for i in intervals if i.state == "unobservable")
    unjudged = sum(i.duration_ns for i in intervals if i.state == "insufficient_data")
    if 2 * unobservable > whole:
        return "unobservable"
    # A log of no length at all cannot be judged either.
    return "insufficient_data" if 2 * (unjudged + unobservable) > whole or not whole else "healthy"


def log_confidence(state: State, intervals: Sequence[Interval]) -> float | None:
    """The mean of the intervals that made the state, each by its length; None if undecided."""
    if state in UNDECIDED:
        return None
    wants = {
        "lost": ("lost", "lost_and_map_changed"),
        "map_changed": ("map_changed", "lost_and_map_changed"),
        "lost_and_map_changed": ("lost", "map_changed", "lost_and_map_changed"),
        "healthy": ("healthy",),
    }[state]
    made = [(i.confidence, i.duration_ns) for i in intervals if i.state in wants]
    sure = [(c, weight) for c, weight in made if c is not None]
    if not sure:
        return None
    return sum(c * weight for c, weight in sure) / sum(weight for _, weight in sure)


def joined(parts: Sequence[Sequence[Interval]]) -> tuple[Interval, ...]:
    """The intervals of neighbouring stretches; where one state goes on they are one."""
    out: list[Interval] = []
    for i in (i for part in parts for i in part):
        if not out or out[-1].state != i.state:
            out.append(i)
            continue
        last = out.pop()
        out.append(
            replace(
                last,
                end_ns=i.end_ns,
                confidence=_both(last, i),
                max_error_m=_most(last.max_error_m, i.max_error_m),
                max_error_rad=_most(last.max_error_rad, i.max_error_rad),
                findings=tuple(dict.fromkeys((*last.findings, *i.findings))),
            )
        )
    return tuple(out)


def _both(one: Interval, other: Interval) -> float | None:
    if one.confidence is None or other.confidence is None:
        return one.confidence if other.confidence is None else other.confidence
    whole = max(one.duration_ns + other.duration_ns, 1)
    share = one.duration_ns / whole
    return share * one.confidence + (1.0 - share) * other.confidence


def _most(*values: float | None) -> float | None:
    return max((v for v in values if v is not None), default=None)


def episodes(intervals: Sequence[Interval], wanted: Callable[[Interval], bool]) -> list[Interval]:
    """Neighbouring intervals that answer one question with yes, made one."""
    found: list[Interval] = []
    for i in intervals:
        if not wanted(i):
            continue
        last = found[-1] if found else None
        if last is None or last.end_ns != i.start_ns:
            found.append(i)
            continue
        found[-1] = replace(
            last,
            end_ns=i.end_ns,
            max_error_m=_most(last.max_error_m, i.max_error_m),
            max_error_rad=_most(last.max_error_rad, i.max_error_rad),
        )
    return found


def _value(timeline: Timeline, t_ns: int) -> int:
    return next((s.value for s in timeline if s.start_ns <= t_ns < s.end_ns), UNKNOWN)
