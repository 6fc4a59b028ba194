"""The timeline across the page: the verdict's intervals as bands, and the stops as marks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from slamreplay.evidence.words import STATES
from slamreplay.report.phrases import seconds, span

if TYPE_CHECKING:
    from slamreplay.evidence.result import Postmortem

#: A texture for each state, as a path over a tile of 8 by 8: colours alone do not tell them apart.
HATCHES = {
    "healthy": "",
    "lost": "M-2 2L2-2M-2 10L10-2M6 10L10 6",
    "map_changed": "M2 2h.01M6 6h.01",
    "lost_and_map_changed": "M0 0L8 8M8 0L0 8",
    "unobservable": "M4 0V8",
    "insufficient_data": "M0 4H8",
}
#: So many stretches are told in words.
_SPELT = 12


@dataclass(frozen=True)
class Band:
    """A stretch of the timeline, or a moment of width 0: its place in thousandths of the log."""

    state: str
    x: float
    width: float
    title: str


def bands(post: Postmortem) -> tuple[Band, ...]:
    """One band for each interval of the verdict."""
    start, whole = post.manifest.start_ns, max(post.manifest.end_ns - post.manifest.start_ns, 1)
    return tuple(
        Band(
            i.state,
            round(1000.0 * (i.start_ns - start) / whole, 3),
            round(1000.0 * (i.end_ns - i.start_ns) / whole, 3),
            f"{STATES[i.state].name}: {span(post, i.start_ns, i.end_ns)}",
        )
        for i in post.judgement.intervals
    )


def marks(post: Postmortem) -> tuple[Band, ...]:
    """One mark for each stop."""
    start, whole = post.manifest.start_ns, max(post.manifest.end_ns - post.manifest.start_ns, 1)
    return tuple(
        Band(
            s.state,
            round(1000.0 * (s.t_ns - start) / whole, 3),
            0.0,
            f"Stop {k} at {seconds(s.t_ns - start)}",
        )
        for k, s in enumerate(post.judgement.stops, start=1)
    )


def timeline_alt(post: Postmortem) -> str:
    """The timeline in words: the first stretches, and how many more there are."""
    shown = bands(post)
    text = "; ".join(band.title for band in shown[:_SPELT])
    more = f"; and {len(shown) - _SPELT} more stretches" if len(shown) > _SPELT else ""
    stops = "; ".join(mark.title for mark in marks(post)[:_SPELT])
    return f"States over the log. {text}{more}. {stops}".rstrip()
