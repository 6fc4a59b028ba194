"""What one scan, laid on a map, can tell at best: no sigma is honestly smaller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.belief.collapse.size import heading_sigma, position_sigma
from slamreplay.consistency.belief.collapse.stretch import Stretch
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry.covariance import planar_from_ros
from slamreplay.geometry.times import NS_PER_S

#: Scans that are looked at; the one with the most returns counts.
_LOOKED = 50
#: A stretch below the floor has so many rows, and lasts so long.
FEWEST, LEAST_NS = 3, NS_PER_S


@dataclass(frozen=True)
class Floor:
    """The smallest standard deviations, and what they are made of in words."""

    position_m: float
    heading_rad: float
    words: str


def sensor_floor(view: BundleView) -> Floor | None:
    """The floor of this log; None where it has neither map and scans nor sightings and fixes.

    A wall in a grid is known to a cell: uniform over its edge r, of variance r^2 / 12. Every beam
    tells the robot's place along the normal of the wall that it meets, with at most that precision,
    so that N beams carry a Fisher information of at most 12 N / r^2 along any direction, and of
    12 sum(d^2) / r^2 on the heading, d their ranges (the bound of Censi 2007, On achievable
    accuracy for range-finder localization, ICRA, with the map's error for the laser's). The safe
    side: all N beams of the fullest scan are taken to be independent, square to the wall, and to
    point in the same direction at once; the laser's own noise, which further scans average out
    while the map stays what it is, comes on top and is left out.

    Sightings of tags and docks and satellite fixes add 1 / sigma^2 each, all of the log as if at
    once; of headings they leave no floor. Where one of them does not tell its noise there is none.
    """
    told = _of_scans(view)
    table = view.table("references")
    if not len(table):
        return told
    variance = planar_from_ros(table["covariance"])[:, [0, 1], [0, 1]].min(axis=1)
    if not (variance > 0.0).all():
        return None
    information = float(np.sum(1.0 / variance))
    words = f"what {len(table)} sightings and fixes can tell at best"
    if told is not None:
        information += told.position_m**-2
        words = f"{told.words}, with {len(table)} sightings and fixes"
    return Floor(information**-0.5, 0.0, words)


def _of_scans(view: BundleView) -> Floor | None:
    grid, table = view.grid, view.role("scan")
    if grid is None or table is None or not len(table):
        return None
    few = table.take(np.unique(np.linspace(0, len(table) - 1, _LOOKED).astype(np.int64)))
    scans = scan_set(view.with_table(few))
    if scans is None or not scans.hits.any():
        return None
    beams = scans.hits.sum(axis=1)
    fullest = int(np.argmax(beams))
    ranges = scans.ranges_m[fullest][scans.hits[fullest]].astype(np.float64)
    cell = grid.resolution_m / np.sqrt(12.0)
    words = (
        f"what {beams[fullest]} beams can tell at best in a map of {grid.resolution_m:g} m cells"
    )
    return Floor(
        float(cell / np.sqrt(beams[fullest])), float(cell / np.sqrt(np.sum(ranges**2))), words
    )


def below_floor(context: CheckContext) -> list[Stretch]:
    """Stretches in which sigma is smaller than what the sensor can tell.

    A stretch at the begin that ends as sigma grows is left out: that is how a map begins that is
    being made, whose first pose is known by definition.
    """
    track = context.belief if context.subject else context.updates
    if track is None or len(track) < FEWEST:
        return []
    floor = sensor_floor(context.view)
    if floor is None:
        return []
    sizes = (position_sigma(track.cov), heading_sigma(track.cov))
    found = []
    for name, size, least in zip(
        ("position", "heading"), sizes, (floor.position_m, floor.heading_rad), strict=True
    ):
        with np.errstate(invalid="ignore"):
            below = size < least
        edges = np.flatnonzero(np.diff(np.concatenate([[False], below, [False]])))
        for first, stop in edges.reshape(-1, 2).tolist():
            start, end = int(track.t_ns[first]), int(track.t_ns[stop - 1])
            born = first == 0 and stop < len(track)
            if born or stop - first < FEWEST or end - start < LEAST_NS:
                continue
            low = float(size[first:stop].min())
            unit = "m" if name == "position" else "rad"
            words = f"sigma of the {name} fell to {low:.2g} {unit}, below the {least:.2g} {unit} "
            words += f"that are {floor.words}"
            factor = least / low if low > 0.0 else np.inf
            found.append(Stretch(start, end, {f"floor {name}": words}, stop - first, factor))
    return found
