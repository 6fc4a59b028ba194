"""Verdicts by robot, site, map, software version and day: rows with bars, the worst first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from slamreplay.fleet.answers import Dimension, Group, Share, Step
from slamreplay.fleet.page import words
from slamreplay.fleet.page.bars import Piece, in_words, pieces
from slamreplay.fleet.page.headline import difference, measure_words
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.phrases import NOT_KNOWN

#: Rows of one table.
MOST_ROWS = {"robot": 25, "site": 30, "map_version": 25, "software": 12, "day": 42}
#: What a table's rows are.
NOUNS: dict[Dimension, tuple[str, str]] = {
    "robot": ("robot", "robots"),
    "site": ("site", "sites"),
    "map_version": ("map", "maps"),
    "software": ("software version", "software versions"),
    "day": ("day", "days"),
}


@dataclass(frozen=True)
class Number:
    """A cell: what it says, a smaller line, and what it is sorted by, empty where not known."""

    text: str
    aside: str = ""
    by: str = ""


@dataclass(frozen=True)
class Row:
    """One robot, site or the like; `aside` is a smaller line under its name."""

    name: str
    aside: str
    bar: tuple[Piece, ...]
    bar_alt: str
    numbers: tuple[Number, ...]


@dataclass(frozen=True)
class GroupTable:
    """Verdicts by one thing.

    Attributes:
        what: as `Dimension`.
        noun: of the first column.
        head: of the numbers' columns.
        rows: the worst first, days and versions the newest first.
        more: how many rows were left out, in words; empty where none was.
    """

    what: Dimension
    noun: str
    head: tuple[str, ...]
    rows: tuple[Row, ...]
    more: str


def group_table(
    what: Dimension,
    groups: Sequence[Group],
    asides: Mapping[str | None, str] | None = None,
) -> GroupTable:
    """The table of one dimension; `asides` are smaller lines under names."""
    order: Callable[[Group], tuple[object, ...]] = (
        _newest_last if what in ("day", "software") else _worst_last
    )
    ordered = sorted(groups, key=order, reverse=True)
    shown = ordered[: MOST_ROWS[what]]
    left = len(ordered) - len(shown)
    one, many = NOUNS[what]
    how = "older" if what in ("day", "software") else "less troubled"
    more = f"{words.count(left, one, many)} more, {how} than these." if left else ""
    rows = tuple(_row(what, group, (asides or {}).get(group.name, "")) for group in shown)
    head = ("logs", "lost", "times lost per km", "time lost", "map changed", "stops")
    return GroupTable(what, one, head, rows, more)


def _worst_last(group: Group) -> tuple[float, float, int, str]:
    """By how often it gets lost at least: a robot lost in its only log is not the worst."""
    low = group.lost.low or 0.0
    return (low, group.changed.low or 0.0, group.logs, group.name or "")


def _newest_last(group: Group) -> tuple[str, str]:
    return (words.day(group.first_day) if group.name else "", group.name or "")


def _row(what: Dimension, group: Group, aside: str) -> Row:
    name = words.map_name(group.name) if what == "map_version" else words.label(group.name)
    failed = f"{group.failed:,} failed" if group.failed else ""
    rate = group.lost_per_km
    time_lost = group.lost_h / group.judged_h if group.judged_h else None
    return Row(
        name,
        aside,
        pieces(group.states),
        in_words(group.states),
        (
            Number(f"{group.logs:,}", failed, str(group.logs)),
            _share(group.lost),
            Number(
                words.two_digits(rate.value) if rate.value is not None else NOT_KNOWN,
                words.interval_of(rate),
                _by(rate.value),
            ),
            Number(
                words.percent(time_lost),
                f"{words.hours(group.lost_h)} of {words.hours(group.judged_h)}",
                _by(time_lost),
            ),
            _share(group.changed),
            Number(f"{group.stops:,}", "", str(group.stops)),
        ),
    )


def _share(share: Share) -> Number:
    within = words.interval_of(share)
    aside = f"{share.count:,} of {share.n:,}{f'; {within}' if within else ''}"
    return Number(words.share_of(share), aside, _by(share.value))


def _by(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def step_table(steps: Sequence[Step]) -> Table:
    """What changed from one software version to the next: what got worse and is newest first."""
    rank = {"worse": 0, "better": 1, "not told apart": 2}
    changes = list(dict.fromkeys((step.before, step.after) for step in steps))
    counted = [step for step in steps if step.was.n and step.now.n]
    rows = [
        (
            f"{step.before} to {step.after}",
            f"logs {measure_words(step.measure)}",
            _of(step.was),
            _of(step.now),
            difference(step),
            step.verdict,
            Cell(words.count(step.sites, "site"), words.count(step.robots, "robot")),
        )
        for step in sorted(
            counted,
            key=lambda one: (rank[one.verdict], -changes.index((one.before, one.after))),
        )
    ]
    head = ("change", "measure", "before", "after", "difference", "verdict", "over")
    return table(head, rows, "the query's answer")


def _of(share: Share) -> Cell:
    return Cell(words.share_of(share), f"{share.count:,} of {share.n:,}")
