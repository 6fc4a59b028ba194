"""Each map with all logs over it: where robots were, where they got lost, where it has aged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from slamreplay.fleet.answers import MapPlaces
from slamreplay.fleet.page import words
from slamreplay.fleet.page.frame import Frame, frame_of
from slamreplay.fleet.page.heat import Blocks, Heat, blocks_of, heat, shares
from slamreplay.fleet.page.map_image import MapImage
from slamreplay.fleet.page.words import Box
from slamreplay.fleet.schema import PLACE_M
from slamreplay.fleet.words import duration
from slamreplay.geometry.se2 import Array
from slamreplay.report.cells import Table, table

#: Maps that are drawn, those that say most first; the others are in a table.
MOST_MAPS = 12
#: Those that are unfolded when the page opens.
OPEN_MAPS = 3
#: A place where robots were for less time than this says nothing of how often they get lost, s.
LEAST_HERE_S = 5.0
#: Rows of the table that says the same.
_MOST_ROWS = 10
_LOST = (0.02, 0.05, 0.1, 0.25)
_AGED = (0.1, 0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Panel:
    """One layer over one map.

    Attributes:
        kind: here, lost or aged: what the page's style colours it by.
        title: what it shows.
        alt: the same with its extremes, for those who do not see it.
        heat: the layer.
        nothing: what stands below where nothing is drawn.
    """

    kind: str
    title: str
    alt: str
    heat: Heat
    nothing: str


@dataclass(frozen=True)
class SiteMap:
    """A map of a site with its layers, and the same as a table."""

    site: str
    version: str
    told: str
    is_open: bool
    image: str
    frame: Frame
    panels: tuple[Panel, ...]
    worst: Table
    note: str


def site_maps(
    maps: Sequence[MapPlaces], images: Mapping[str, tuple[str, MapImage]]
) -> tuple[SiteMap, ...]:
    """The maps to be drawn.

    Args:
        maps: with places; others say nothing here.
        images: by version: id on the page, and the image; a map that is not there is drawn without.
    """
    return tuple(
        _site_map(one, images.get(one.map_version), is_open=k < OPEN_MAPS)
        for k, one in enumerate(maps[:MOST_MAPS])
    )


def by_trouble(maps: Sequence[MapPlaces]) -> tuple[MapPlaces, ...]:
    """Those with places: in use first, then by the time lost there and what contradicts them."""
    return tuple(
        sorted(
            (one for one in maps if len(one.col)),
            key=lambda one: (
                not one.in_use,
                -float(one.lost_s.sum()),
                -int(one.against.sum()),
                one.site or "",
                one.map_version,
            ),
        )
    )


def _site_map(one: MapPlaces, image: tuple[str, MapImage] | None, *, is_open: bool) -> SiteMap:
    places = blocks_of(one.col, one.row)
    edge = PLACE_M * places.size
    box: Box = (
        float(places.col.min() * edge),
        float(places.row.min() * edge),
        float((places.col.max() + 1) * edge),
        float((places.row.max() + 1) * edge),
    )
    if image is not None:
        a, b = box, image[1].box_m
        box = (min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3]))
    at = [f"{x * edge:g} to {(x + 1) * edge:g}, {y * edge:g} to {(y + 1) * edge:g} m"
          for x, y in zip(places.col.tolist(), places.row.tolist(), strict=True)]  # fmt: skip
    return SiteMap(
        words.label(one.site),
        words.map_name(one.map_version),
        f"{words.count(one.logs, 'log')} of {words.count(one.robots, 'robot')}, "
        f"{words.span_of_days(one.first_day, one.last_day)}"
        f"{'' if one.in_use else '; no longer in use'}",
        is_open,
        "" if image is None else image[0],
        frame_of(box),
        _panels(one, places, at),
        _worst(one, places, at),
        f"A square is {edge:g} m wide. Where robots were for less than {LEAST_HERE_S:g} s in all "
        "nothing is said of how often they get lost.",
    )


def _panels(one: MapPlaces, places: Blocks, at: Sequence[str]) -> tuple[Panel, ...]:
    here, lost = places.sum(one.here_s), places.sum(one.lost_s)
    return (_traffic(places, here, at), _lost(places, here, lost, at), _aged(one, places, at))


def _traffic(places: Blocks, here: Array, at: Sequence[str]) -> Panel:
    most = float(here.max(initial=0.0))
    bounds = [most / 16, most / 8, most / 4, most / 2]
    edges = [duration(s) for s in (*bounds, most)]
    classes = [
        f"up to {edges[0]}",
        *(f"{a} to {b}" for a, b in pairwise(edges)),
    ]
    texts = [f"{where}: {duration(s)}" for where, s in zip(at, here, strict=True)]
    return Panel(
        "here",
        "Where robots were",
        f"Map with the time that robots were at each place, at most {edges[-1]}.",
        heat(places, here, bounds=bounds, classes=classes, texts=texts),
        "No path is known.",
    )


def _lost(places: Blocks, here: Array, lost: Array, at: Sequence[str]) -> Panel:
    share = shares(lost, here, LEAST_HERE_S)
    texts = [
        f"{where}: lost {words.percent(s)} of {duration(h)}"
        for where, s, h in zip(at, share, here, strict=True)
    ]
    return Panel(
        "lost",
        "Where they were lost",
        "Map with the share of that time in which they were lost. " + _highest(share, texts),
        heat(places, share, bounds=_LOST, classes=_ranges(_LOST), texts=texts),
        "No robot was lost on this map.",
    )


def _aged(one: MapPlaces, places: Blocks, at: Sequence[str]) -> Panel:
    looks, against = places.greatest(one.looks), places.greatest(one.against)
    share = shares(against, looks)
    texts = [
        f"{where}: {a:.0f} of {words.count(int(n), 'log')} that looked contradict the map"
        for where, a, n in zip(at, against, looks, strict=True)
    ]
    return Panel(
        "aged",
        "Where the map has aged",
        "Map with the share of logs that contradict it. " + _highest(share, texts),
        heat(places, share, bounds=_AGED, classes=_ranges(_AGED), texts=texts),
        "No log contradicts this map.",
    )


def _highest(share: Array, texts: Sequence[str]) -> str:
    if not (share > 0.0).any():
        return "Nowhere."
    return f"The highest is at {texts[int(np.argmax(share))]}."


def _ranges(bounds: Sequence[float]) -> list[str]:
    edges = [f"{100.0 * b:g}" for b in bounds]
    between = [f"{a} to {b} %" for a, b in pairwise(edges)]
    return [f"up to {edges[0]} %", *between, f"over {edges[-1]} %"]


def _worst(one: MapPlaces, places: Blocks, at: Sequence[str]) -> Table:
    here, lost = places.sum(one.here_s), places.sum(one.lost_s)
    entered = places.sum(one.entered)
    passed, gone = places.greatest(one.passed), places.greatest(one.lost_logs)
    looks, against = places.greatest(one.looks), places.greatest(one.against)
    told = np.flatnonzero((lost > 0.0) | (against > 0))
    order = told[np.lexsort((-against[told], -lost[told]))]
    rows = [
        (
            at[i],
            duration(here[i]),
            duration(lost[i]),
            f"{entered[i]:.0f}",
            f"{gone[i]:.0f} of {passed[i]:.0f}",
            f"{against[i]:.0f} of {looks[i]:.0f}",
        )
        for i in order[:_MOST_ROWS].tolist()
    ]
    head = ("x, y", "time there", "of it lost", "became lost", "logs lost", "logs against the map")
    return table(head, rows, "")
