"""Everything the page's template prints, as plain text and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from slamreplay.evidence.words import STATES
from slamreplay.fleet.answers import Answers
from slamreplay.fleet.page import headline, logs, remap, words
from slamreplay.fleet.page.bars import ORDER, Column, Piece, columns, in_words, pieces
from slamreplay.fleet.page.groups import GroupTable, group_table, step_table
from slamreplay.fleet.page.links import Reports
from slamreplay.fleet.page.map_image import MapImage
from slamreplay.fleet.page.site_maps import MOST_MAPS, SiteMap, by_trouble, site_maps
from slamreplay.fleet.queries import Query, queries, views
from slamreplay.report.cells import Table, table
from slamreplay.report.timeline import HATCHES
from slamreplay.version import __version__

#: Days of the trend; what is older is in the table of days, as far as that goes.
_MOST_DAYS = 42
#: Up to here logs of one robot are as different as those of several.
_HARDLY_ALIKE = 1.05


@dataclass(frozen=True)
class Image:
    """A map's image and its id on the page."""

    id: str
    image: MapImage


@dataclass(frozen=True)
class FleetView:
    """What stands on the page; see the parts' own classes."""

    version: str
    title: str
    when: str
    tone: str
    sentence: str
    facts: tuple[headline.Fact, ...]
    bar: tuple[Piece, ...]
    bar_alt: str
    legend: tuple[tuple[str, str, str], ...]
    hatches: tuple[tuple[str, str], ...]
    columns: tuple[Column, ...]
    columns_alt: str
    columns_note: str
    most_a_day: int
    images: tuple[Image, ...]
    judged: int
    remap_count: int
    cards: tuple[remap.Card, ...]
    cards_more: int
    areas: Table
    picks: tuple[logs.PickRow, ...]
    picks_more: int
    maps: tuple[SiteMap, ...]
    maps_more: int
    causes: tuple[logs.CauseRow, ...]
    steps: Table
    groups: tuple[GroupTable, ...]
    software: GroupTable
    gate_rows: Table
    failed: int
    failures: Table
    copies: Table
    remarks: tuple[str, ...]
    alike: str
    sql: Mapping[str, Query]
    views: str


def versions_drawn(answers: Answers) -> tuple[str, ...]:
    """The map versions whose images the page needs."""
    areas = remap.needed(answers.areas)[: remap.MOST_CARDS]
    maps = by_trouble(answers.maps)[:MOST_MAPS]
    return tuple(dict.fromkeys([*(a.map_version for a in areas), *(m.map_version for m in maps)]))


def view_of(answers: Answers, images: Mapping[str, MapImage]) -> FleetView:
    """The page of a fleet.

    Args:
        answers: of its tables.
        images: by map version, of `versions_drawn`, those that are there.
    """
    total, reports = answers.total, Reports(answers)
    named = {version: (f"map-{k}", image) for k, (version, image) in enumerate(images.items())}
    needed, maps = remap.needed(answers.areas), by_trouble(answers.maps)
    cards = remap.cards(needed, answers.maps, named, reports)
    others = (*needed[remap.MOST_CARDS :], *(a for a in answers.areas if a.advice != "re-map"))
    sites: dict[str | None, str] = {one.map_version: words.label(one.site) for one in answers.maps}
    picks = logs.picks(answers.picks, reports)
    days = [(g.name, g.states) for g in answers.by["day"] if g.name is not None]
    return FleetView(
        version=__version__,
        title=words.logs_of_robots(total)
        + (f" at {words.count(total.sites, 'site')}" if total.sites else ""),
        when=words.span_of_days(total.first_day, total.last_day),
        tone=headline.tone(answers),
        sentence=headline.sentence(answers),
        facts=headline.facts(answers),
        bar=pieces(total.states),
        bar_alt=f"Logs by state: {in_words(total.states)}.",
        legend=tuple(
            (s, STATES[s].name, f"{total.states[s]:,}") for s in ORDER if total.states.get(s)
        ),
        hatches=tuple(HATCHES.items()),
        columns=columns([(name, states) for name, states in days[-_MOST_DAYS:]]),
        columns_alt="Logs of the last days by state. "
        + "; ".join(f"{name}: {in_words(states)}" for name, states in days[-7:])
        + ".",
        columns_note=_older(len(days)),
        most_a_day=max((sum(states.values()) for _, states in days[-_MOST_DAYS:]), default=0),
        images=tuple(Image(name, image) for name, image in named.values()),
        judged=total.lost.n,
        remap_count=len(needed),
        cards=cards,
        cards_more=len(needed) - len(cards),
        areas=remap.rest(others, reports),
        picks=picks,
        picks_more=len(answers.picks) - len(picks),
        maps=site_maps(maps, named),
        maps_more=max(len(maps) - MOST_MAPS, 0),
        causes=logs.causes(answers.causes, reports),
        steps=step_table(answers.steps),
        groups=tuple(
            group_table(what, answers.by[what], sites if what == "map_version" else None)
            for what in ("robot", "site", "map_version", "day")
        ),
        software=group_table("software", answers.by["software"]),
        gate_rows=_gate(answers),
        failed=total.failed,
        failures=logs.failures(answers.failures),
        copies=logs.copies(answers.copies),
        remarks=answers.remarks,
        alike=f"{answers.alike:.1f}" if answers.alike > _HARDLY_ALIKE else "",
        sql={query.name: query for query in queries()},
        views=views(),
    )


def _older(days: int) -> str:
    left = days - _MOST_DAYS
    return f"{words.count(left, 'older day')} not shown." if left > 0 else ""


def _gate(answers: Answers) -> Table:
    rows = [
        (words.label(g.name), f"{g.gate_failed.count:,} of {g.gate_failed.n:,}",
         words.share_of(g.gate_failed), words.interval_of(g.gate_failed))
        for g in answers.by["site"]
        if g.gate_failed.n
    ]  # fmt: skip
    return table(("site", "logs that it failed", "share", "95 %"), rows, "the query's answer")
