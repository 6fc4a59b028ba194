"""Flags per scan turned into stretches of time: held, bridged, and rid of what is too short."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

GOOD, BAD, UNKNOWN = 0, 1, 2

#: A sample holds for so many of the samples' usual spacings, where that is longer than a bridge.
HOLD_SPACINGS = 3


@dataclass(frozen=True)
class Stretch:
    """Times [start_ns, end_ns) of one value."""

    value: int
    start_ns: int
    end_ns: int

    @property
    def duration_ns(self) -> int:
        """How long it lasts."""
        return self.end_ns - self.start_ns


Timeline = tuple[Stretch, ...]


def held(
    t_ns: NDArray[np.int64], flags: NDArray[np.int8], start_ns: int, end_ns: int, bridge_ns: int
) -> Timeline:
    """Flags (N,) at sorted times (N,), each held until the next sample, over [start_ns, end_ns).

    Where the next sample is farther away than `bridge_ns` and three usual spacings, a sample holds
    for one usual spacing and then nothing is known: held longer, each gap would add to the time
    that is lost, and one of a little over a second would be bridged. The first one also holds that
    far backwards.
    """
    if end_ns <= start_ns:
        return ()
    if not len(t_ns):
        return (Stretch(UNKNOWN, start_ns, end_ns),)
    usual = int(np.median(np.diff(t_ns))) if len(t_ns) > 1 else 0
    reach = max(bridge_ns, HOLD_SPACINGS * usual)
    after = np.append(t_ns[1:], max(end_ns, int(t_ns[-1])))
    until = np.where(after - t_ns <= reach, after, t_ns + (usual or reach))
    first = int(flags[0]) if int(t_ns[0]) - start_ns <= reach else UNKNOWN
    # Each sample is followed by what nothing is known of, mostly of no length.
    pairs = np.stack([flags, np.full(len(flags), UNKNOWN)], axis=1).ravel()
    value = np.append(first, pairs)
    edges = np.append(min(start_ns, int(t_ns[0])), np.stack([t_ns, until], axis=1).ravel())
    return _joined(
        value,
        np.maximum(edges, start_ns),
        np.minimum(np.append(edges[1:], after[-1]), end_ns),
    )


def _joined(
    value: NDArray[np.int64], start_ns: NDArray[np.int64], end_ns: NDArray[np.int64]
) -> Timeline:
    """As `merged`, of stretches as arrays (N,)."""
    there = end_ns > start_ns
    value, start_ns, end_ns = value[there], start_ns[there], end_ns[there]
    begins = np.flatnonzero(np.append(True, value[1:] != value[:-1])[: len(value)])
    ends = np.append(begins[1:], len(value)) - 1
    return tuple(
        Stretch(int(value[a]), int(start_ns[a]), int(end_ns[b]))
        for a, b in zip(begins, ends[: len(begins)], strict=True)
    )


def settled(timeline: Timeline, min_ns: int, bridge_ns: int) -> Timeline:
    """A timeline without flicker; settling it again changes nothing.

    Interruptions of BAD shorter than `bridge_ns` are closed; BAD shorter than `min_ns` is none;
    GOOD shorter than `bridge_ns` between two UNKNOWN says nothing; UNKNOWN shorter than that takes
    the better of its neighbours.
    """
    return _filled(_doubted(_dropped(_bridged(timeline, bridge_ns), min_ns), bridge_ns), bridge_ns)


def merged(parts: Iterable[Stretch]) -> Timeline:
    """Neighbours of one value made one; empty stretches left out."""
    out: list[Stretch] = []
    for part in parts:
        if part.end_ns <= part.start_ns:
            continue
        if out and out[-1].value == part.value:
            out[-1] = Stretch(part.value, out[-1].start_ns, part.end_ns)
        else:
            out.append(part)
    return tuple(out)


def _bridged(timeline: Timeline, bridge_ns: int) -> Timeline:
    bad = [s for s in timeline if s.value == BAD]
    short = [(a.end_ns, b.start_ns) for a, b in pairwise(bad) if b.start_ns - a.end_ns < bridge_ns]
    inside = [any(low <= s.start_ns and s.end_ns <= high for low, high in short) for s in timeline]
    return merged(
        Stretch(BAD if hit else s.value, s.start_ns, s.end_ns)
        for s, hit in zip(timeline, inside, strict=True)
    )


def _neighbours(timeline: Timeline, i: int) -> list[int]:
    return [timeline[k].value for k in (i - 1, i + 1) if 0 <= k < len(timeline)]


def _dropped(timeline: Timeline, min_ns: int) -> Timeline:
    out = []
    for i, s in enumerate(timeline):
        value = s.value
        if value == BAD and s.duration_ns < min_ns:
            around = set(_neighbours(timeline, i))
            value = UNKNOWN if around == {UNKNOWN} else GOOD
        out.append(Stretch(value, s.start_ns, s.end_ns))
    return merged(out)


def _doubted(timeline: Timeline, bridge_ns: int) -> Timeline:
    out = []
    for i, s in enumerate(timeline):
        lone = s.value == GOOD and s.duration_ns < bridge_ns
        value = UNKNOWN if lone and _neighbours(timeline, i) == [UNKNOWN, UNKNOWN] else s.value
        out.append(Stretch(value, s.start_ns, s.end_ns))
    return merged(out)


def _filled(timeline: Timeline, bridge_ns: int) -> Timeline:
    out = []
    for i, s in enumerate(timeline):
        value = s.value
        if value == UNKNOWN and s.duration_ns < bridge_ns:
            value = min(_neighbours(timeline, i), default=UNKNOWN)
        out.append(Stretch(value, s.start_ns, s.end_ns))
    return merged(out)
