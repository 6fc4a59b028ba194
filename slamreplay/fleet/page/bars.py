"""Counts of states as a bar from edge to edge, and days as columns of such bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from slamreplay.evidence.words import STATES
from slamreplay.verdict.judgement import State

#: In a bar from left to right, in a column from below: the worst first, what says nothing last.
ORDER: tuple[State, ...] = (
    "lost",
    "lost_and_map_changed",
    "map_changed",
    "unobservable",
    "healthy",
    "insufficient_data",
)


@dataclass(frozen=True)
class Piece:
    """A part of a bar: from `start`, `size` long, both in per cent of the whole bar."""

    state: State
    start: float
    size: float
    title: str


@dataclass(frozen=True)
class Column:
    """A day: its bar's pieces from below, and where it stands, in per cent of the width."""

    x: float
    width: float
    pieces: tuple[Piece, ...]
    label: str
    is_labelled: bool


def pieces(counts: Mapping[State, int], whole: int | None = None) -> tuple[Piece, ...]:
    """The parts of a bar.

    Args:
        counts: logs by state.
        whole: what a bar of full length would be; the sum of the counts by default.
    """
    total = sum(counts.values())
    whole = max(whole or total, 1)
    out, start = [], 0.0
    for state in ORDER:
        count = counts.get(state, 0)
        if count:
            size = 100.0 * count / whole
            title = f"{STATES[state].name}: {count:,} of {total:,} logs"
            out.append(Piece(state, round(start, 3), round(size, 3), title))
            start += size
    return tuple(out)


def in_words(counts: Mapping[State, int]) -> str:
    """A bar as text."""
    told = [f"{STATES[s].name} {counts[s]:,}" for s in ORDER if counts.get(s, 0)]
    return ", ".join(told) or "no logs"


def columns(
    days: Sequence[tuple[str, Mapping[State, int]]], labels: int = 10
) -> tuple[Column, ...]:
    """A column for each day; the highest fills the height, and about so many have their label."""
    highest = max((sum(counts.values()) for _, counts in days), default=0)
    pitch, every = 100.0 / max(len(days), 1), -(-len(days) // labels)
    last = len(days) - 1
    return tuple(
        Column(
            round(k * pitch + 0.12 * pitch, 3),
            round(0.76 * pitch, 3),
            tuple(
                Piece(p.state, p.start, p.size, f"{label}. {p.title}")
                for p in pieces(counts, highest)
            ),
            label,
            (last - k) % every == 0,
        )
        for k, (label, counts) in enumerate(days)
    )
