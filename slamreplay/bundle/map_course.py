"""Which map held when, and over which stretches of a log the maps were of one place."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from slamreplay.bundle.tables import Table
from slamreplay.geometry.times import NS_PER_S
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.versions import same_place

#: A map of another place that held for less than this is not judged by itself: a robot cannot be
#: found in it by what it saw meanwhile. Two publishers of one topic also look like this.
SHORTEST_NS = 10 * NS_PER_S


@dataclass(frozen=True)
class Held:
    """A map version and the time [start_ns, end_ns) over which it held."""

    version: str
    start_ns: int
    end_ns: int


@dataclass(frozen=True)
class MapStretch:
    """A part of a log over which the maps were of one place, one version after the other.

    The robot is looked for in the last version; each moment's beams are compared with the version
    that held then.
    """

    held: tuple[Held, ...]

    @property
    def start_ns(self) -> int:
        """Its first moment."""
        return self.held[0].start_ns

    @property
    def end_ns(self) -> int:
        """The moment after its last."""
        return self.held[-1].end_ns

    @property
    def version(self) -> str:
        """The last of its versions."""
        return self.held[-1].version


def map_course(updates: Table, kept: Sequence[str], start_ns: int, end_ns: int) -> tuple[Held, ...]:
    """The versions that held over [start_ns, end_ns), without gap or overlap; none without a map.

    Before the first one the first one holds: latched maps are recorded late. Where a version was
    not kept the last kept one before it holds on.

    Args:
        updates: table `map_updates`.
        kept: versions that the bundle has, the newest last; it holds all along where no row names
            any of them.
        start_ns: the log's first moment.
        end_ns: its last one.
    """
    if not kept:
        return ()
    rows = updates.take(np.isin(updates["map_version"].astype(str), kept)).sorted_by_time()
    rows = rows.take((rows.t_ns < end_ns) | (np.arange(len(rows)) == 0))
    if not len(rows):
        return (Held(kept[-1], start_ns, end_ns),)
    names = rows["map_version"].astype(str)
    since = np.maximum(rows.t_ns, start_ns)
    since[0] = start_ns
    # Of rows before the start only the last one held; the same version told again is no change.
    keep = np.append(since[1:] > since[:-1], True)
    names, since = names[keep], since[keep]
    keep = np.append(True, names[1:] != names[:-1])
    names, since = names[keep], since[keep]
    until = np.append(since[1:], end_ns)
    return tuple(
        Held(name, first, last)
        for name, first, last in zip(names.tolist(), since.tolist(), until.tolist(), strict=True)
    )


def renamed(course: Sequence[Held], new: Mapping[str, str]) -> tuple[Held, ...]:
    """The course with other versions in place of some; what has become one version is one entry."""
    found: list[Held] = []
    for held in course:
        held = replace(held, version=new.get(held.version, held.version))
        if found and found[-1].version == held.version:
            held = replace(found.pop(), end_ns=held.end_ns)
        found.append(held)
    return tuple(found)


def map_stretches(
    course: Sequence[Held], grid_of: Callable[[str], OccupancyGrid | None]
) -> tuple[MapStretch, ...]:
    """The course cut wherever the place changes.

    Args:
        course: versions without gap or overlap.
        grid_of: the grid of a version.
    """
    if len({h.version for h in course}) < 2:
        return (MapStretch(tuple(course)),) if course else ()
    found: list[list[Held]] = []
    alike: dict[tuple[str, str], bool] = {}
    newest: OccupancyGrid | None = None
    for held in reversed(course):
        pair = (held.version, found[-1][0].version) if found else ("", "")
        if found and pair not in alike:
            old = grid_of(held.version)
            alike[pair] = old is not None and newest is not None and same_place(old, newest)
        if found and (pair[0] == pair[1] or alike[pair]):
            found[-1].append(held)
        else:
            found.append([held])
            newest = grid_of(held.version)
    return _long_enough([tuple(reversed(part)) for part in reversed(found)])


def _long_enough(parts: Sequence[tuple[Held, ...]]) -> tuple[MapStretch, ...]:
    """Without those too short to be judged: the one before holds on, or the one after does."""
    kept: list[tuple[Held, ...]] = []
    start_ns = parts[0][0].start_ns
    for part in parts:
        if part[-1].end_ns - part[0].start_ns >= SHORTEST_NS:
            if not kept:
                part = (replace(part[0], start_ns=start_ns), *part[1:])
            if kept and kept[-1][-1].version == part[0].version:
                part = (*kept.pop(), *part)
            kept.append(part)
        elif kept:
            kept[-1] = (*kept[-1][:-1], replace(kept[-1][-1], end_ns=part[-1].end_ns))
    if not kept:
        last = parts[-1][-1]
        kept = [(replace(last, start_ns=start_ns),)]
    return tuple(MapStretch(part) for part in kept)
