"""Causes, the logs worth looking at first, logs that failed, and logs that lie there twice."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from slamreplay.evidence.words import FAILURE_MODES, STATES
from slamreplay.fleet.answers import Cause, Copies, Failure, Pick
from slamreplay.fleet.page import words
from slamreplay.fleet.page.bars import Piece
from slamreplay.fleet.page.links import Link, Reports, short_name
from slamreplay.report.cells import Cell, Table, table

#: Rows of each list.
MOST_PICKS, MOST_ALIKE, MOST_CAUSES = 20, 3, 12
_IN_ANSWER = "the query's answer"


@dataclass(frozen=True)
class PickRow:
    """A log worth looking at: its report, where it is from, what is odd about it."""

    link: Link
    where: str
    state: str
    state_name: str
    reason: str
    alike: str


@dataclass(frozen=True)
class CauseRow:
    """A cause with a bar of the time that it cost, by the longest one, and its numbers."""

    name: str
    bar: tuple[Piece, ...]
    bar_alt: str
    lost: str
    logs: str
    where: str
    replayed: str
    example: Link


def picks(all_picks: Sequence[Pick], reports: Reports) -> tuple[PickRow, ...]:
    """The first ones; of logs of one kind at one site no more than `MOST_ALIKE`."""
    met: Counter[tuple[str, str | None]] = Counter()
    shown = []
    for pick in all_picks:
        met[pick.kind, pick.site] += 1
        if met[pick.kind, pick.site] <= MOST_ALIKE:
            shown.append(pick)
    return tuple(
        PickRow(
            reports.to(pick.key, short_name(pick.log), pick.report),
            ", ".join((words.label(pick.site), words.label(pick.robot), words.day(pick.day))),
            pick.state or "insufficient_data",
            STATES[pick.state].name if pick.state else "Failed",
            _reason(pick),
            "" if pick.alike < 2 else f"{pick.alike:,} alike",
        )
        for pick in shown[:MOST_PICKS]
    )


def _reason(pick: Pick) -> str:
    kind = FAILURE_MODES.get(pick.kind)
    text = pick.reason if kind is None else f"{kind}: {pick.reason}"
    return f"{text[:1].upper()}{text[1:]}"


def causes(all_causes: Sequence[Cause], reports: Reports) -> tuple[CauseRow, ...]:
    """What cost the most hours of lost robots first."""
    shown = all_causes[:MOST_CAUSES]
    longest = max((cause.lost_h + cause.changed_h for cause in shown), default=0.0) or 1.0
    return tuple(
        CauseRow(
            FAILURE_MODES.get(cause.kind, cause.kind.replace("_", " ")),
            _bar(cause, longest),
            f"{words.hours(cause.lost_h)} lost, {words.hours(cause.changed_h)} in a changed map",
            f"{words.hours(cause.lost_h)} lost, {words.hours(cause.changed_h)} in a changed map, "
            f"{words.count(cause.stops, 'stop')}",
            words.count(cause.logs, "log"),
            f"{words.count(cause.robots, 'robot')}, {words.count(cause.sites, 'site')}",
            f"{cause.replayed:,} reproduced by a replay" if cause.replayed else "not reproduced",
            reports.of(cause.example),
        )
        for cause in shown
    )


def _bar(cause: Cause, longest: float) -> tuple[Piece, ...]:
    lost, changed = (round(100.0 * h / longest, 2) for h in (cause.lost_h, cause.changed_h))
    both = (
        Piece("lost", 0.0, lost, f"lost for {words.hours(cause.lost_h)}"),
        Piece("map_changed", lost, changed, f"map changed for {words.hours(cause.changed_h)}"),
    )
    return tuple(piece for piece in both if piece.size)


def failures(all_failures: Sequence[Failure]) -> Table:
    """Logs that could not be read or judged, with the line that says why."""
    rows = [
        (Cell(short_name(one.log), f"{words.label(one.site)}, {words.label(one.robot)}"), one.error)
        for one in all_failures
    ]
    return table(("log", "why"), rows, _IN_ANSWER)


def copies(all_copies: Sequence[Copies]) -> Table:
    """Logs that occur more than once, with all their names."""
    rows = [(f"{len(one.logs):,} times", Cell(", ".join(one.logs))) for one in all_copies]
    return table(("found", "under these names"), rows, _IN_ANSWER)
