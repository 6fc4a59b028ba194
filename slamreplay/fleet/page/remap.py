"""Which aisles need re-mapping: the parts of maps that logs contradict, the most urgent first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from slamreplay.fleet.answers import Area, MapPlaces
from slamreplay.fleet.page import words
from slamreplay.fleet.page.frame import Frame, around, frame_of, nice
from slamreplay.fleet.page.heat import Shade, blocks_of, heat, shares
from slamreplay.fleet.page.links import Link, Reports
from slamreplay.fleet.page.map_image import MapImage
from slamreplay.fleet.page.words import Box
from slamreplay.fleet.schema import PLACE_M
from slamreplay.fleet.words import duration
from slamreplay.report.cells import Cell, Table, table
from slamreplay.verdict.words import square_metres

#: So many are shown with a piece of their map.
MOST_CARDS = 10
_ASPECT, _MARGIN_M, _LEAST_M = 4.0 / 3.0, 5.0, 16.0
_LEVELS = (0.1, 0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Card:
    """An area with a piece of its map.

    Attributes:
        title: where it is.
        m2: how large.
        since: the day when it was first seen.
        short: who saw it, and what it costs.
        facts: name and value.
        why: the reason in a sentence.
        log: the latest one that says so.
        frame: of the piece.
        whole: of all of the map, with the area somewhere in it; None where the map is not there.
        image: id of the map's image on the page, empty where the map is not there.
        box: x, y, width and height of the area, m.
        shades: what share of logs contradicts each place of it.
        bar: x and width of a scale bar in units of the drawing, and its length in words.
        alt: the picture in words.
    """

    title: str
    m2: str
    since: str
    short: str
    facts: tuple[tuple[str, str], ...]
    why: str
    log: Link
    frame: Frame
    whole: Frame | None
    image: str
    box: tuple[float, float, float, float]
    shades: tuple[Shade, ...]
    bar: tuple[float, float, str]
    alt: str


def needed(areas: Sequence[Area]) -> tuple[Area, ...]:
    """Those to be mapped again, the most urgent first."""
    return tuple(area for area in areas if area.advice == "re-map")


def cards(
    areas: Sequence[Area],
    maps: Sequence[MapPlaces],
    images: Mapping[str, tuple[str, MapImage]],
    reports: Reports,
) -> tuple[Card, ...]:
    """The first of them, each with a piece of its map."""
    by_map = {(one.site, one.map_version): one for one in maps}
    return tuple(
        _card(
            area, by_map.get((area.site, area.map_version)), images.get(area.map_version), reports
        )
        for area in areas[:MOST_CARDS]
    )


def rest(areas: Sequence[Area], reports: Reports) -> Table:
    """Areas as rows: those that had no room, that may still settle, or that did."""
    head = ("advice", "site", "where", "area", "since", "logs, robots", "later looks",
            "lost nearby since", "latest log")  # fmt: skip
    rows = [
        (
            area.advice,
            words.label(area.site),
            Cell(words.place(area.box_m), f"map {words.map_name(area.map_version)}"),
            square_metres(area.m2),
            words.day(area.first_day),
            f"{area.logs:,} of {words.count(area.robots, 'robot')}",
            _still(area),
            duration(area.lost_near_s),
            _cell(reports.of(area.example)),
        )
        for area in areas
    ]
    return table(head, rows, "the query's answer")


def _cell(link: Link) -> Cell:
    return Cell(link.text, links=((link.text, link.href),) if link.href else ())


def _card(
    area: Area, places: MapPlaces | None, image: tuple[str, MapImage] | None, reports: Reports
) -> Card:
    piece = around(area.box_m, margin_m=_MARGIN_M, aspect=_ASPECT, least_m=_LEAST_M)
    frame = frame_of(piece, axes=False)
    x0, y0, x1, y1 = area.box_m
    length = nice(frame.clip[2] / frame.metre / 8.0)
    title = f"{words.label(area.site)}, {words.place(area.box_m)}"
    lost = duration(area.lost_near_s)
    facts = (
        ("since", f"{words.day(area.first_day)}, last seen {words.day(area.last_day)}"),
        ("seen by", f"{words.count(area.logs, 'log')} of {words.count(area.robots, 'robot')}"),
        ("still so", _still(area)),
        ("it costs", f"{lost} lost nearby since; {words.hours(area.near_h)} driven there in all"),
        ("map", words.map_name(area.map_version)),
    )  # fmt: skip
    return Card(
        title,
        square_metres(area.m2),
        words.day(area.first_day),
        f"{words.count(area.logs, 'log')} of {words.count(area.robots, 'robot')}, {_still(area)}; "
        f"{lost} lost nearby since",
        facts,
        area.why,
        reports.of(area.example),
        frame,
        None if image is None else frame_of(image[1].box_m, axes=False),
        "" if image is None else image[0],
        (x0, y0, x1 - x0, y1 - y0),
        _shades(places, piece),
        (12.0, round(length * frame.metre, 2), f"{length:g} m"),
        f"Piece of the map of {words.label(area.site)} with the area that has aged: {title}.",
    )


def _shades(places: MapPlaces | None, piece: Box) -> tuple[Shade, ...]:
    if places is None:
        return ()
    x, y = (places.col + 0.5) * PLACE_M, (places.row + 0.5) * PLACE_M
    near = (x > piece[0]) & (x < piece[2]) & (y > piece[1]) & (y < piece[3])
    blocks = blocks_of(places.col[near], places.row[near])
    looks, against = blocks.greatest(places.looks[near]), blocks.greatest(places.against[near])
    share = shares(against, looks)
    classes = [""] * (len(_LEVELS) + 1)
    return heat(blocks, share, bounds=_LEVELS, classes=classes, texts=[""] * len(share)).shades


def _still(area: Area) -> str:
    if not area.visits:
        return "nobody came back yet"
    looks = f"{area.still:,} of {words.count(area.visits, 'later look')}"
    if area.latest > 1:
        return f"{looks}, the latest {area.latest:,} in a row"
    if area.latest == 1:
        return f"{looks}, the latest one too"
    return f"{looks}, not the latest {words.count(-area.latest, 'one')}"
