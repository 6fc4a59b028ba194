"""Which parts of a map are no longer true, and whether that stays: what to map again.

One log that contradicts the map may have met a pallet. What counts is what later logs saw there:
places that the latest looks contradict are laid together to areas apart from those that were found
right again, and each area is judged by the logs that looked at it, one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slamreplay.fleet.answers import NEAR_M, Advice, Area
from slamreplay.fleet.cells import AGAINST_M2, Ints, Maps, Rows, of_map, split, starts
from slamreplay.fleet.changed_regions import Kinds
from slamreplay.fleet.counted import Counted, Flags
from slamreplay.fleet.course import RECENT, Course, advice_on, course_of
from slamreplay.fleet.gathered import AGAINST, HERE, Gathered, looks
from slamreplay.fleet.in_use import InUse
from slamreplay.fleet.schema import PLACE_M
from slamreplay.geometry import se2

if TYPE_CHECKING:
    from slamreplay.fleet.snapshot import Snapshot

#: A place may be wrong now if one of so many latest looks says so: the edge of what was moved is
#: seen from one side only. Others were found right again, and are laid together apart from these.
LATEST_LOOKS = 3
#: Places this far from each other, in rows or columns, are of one area: a gap of one is bridged.
GAP = 2
_S_PER_H = 3600.0


@dataclass(frozen=True, eq=False)
class Looks:
    """Logs looking at places that one of them contradicts at least, by place and time: (N,) rows.

    Attributes:
        place: row of `codes`.
        log: of the counted logs.
        against: whether it contradicts the map there.
        seen_m2: what it saw of the place.
        contradicted_m2: what of that contradicts the map.
        codes: of the places.
    """

    place: Ints
    log: Ints
    against: Flags
    seen_m2: se2.Array
    contradicted_m2: se2.Array
    codes: Ints


def time_order(logs: Counted) -> Ints:
    """(N,) rank of each log by its start, then by its key."""
    rank = np.empty(len(logs), dtype=np.int64)
    rank[np.argsort(logs.start_ns, kind="stable")] = np.arange(len(logs))
    return rank


def looks_at_changes(now: Snapshot, logs: Counted, found: Gathered) -> Looks:
    """Read the places again, those only that a log contradicts."""
    maps = Maps(logs, found.maps)
    codes = found.places.code[found.places.added[:, AGAINST] > 0]
    held: list[Rows] = []
    for rows in maps.rows(now, ("seen_m2", "contradicted_m2")):
        at = np.minimum(np.searchsorted(codes, rows.code), max(0, len(codes) - 1))
        there = codes[at] == rows.code if len(codes) else np.zeros(len(rows.code), dtype=bool)
        held.append(rows.take(there & looks(rows, logs)[0]))
    code = np.concatenate([np.empty(0, np.int64), *(rows.code for rows in held)])
    log = np.concatenate([np.empty(0, np.int64), *(rows.log for rows in held)])
    seen, contradicted = (
        np.concatenate([np.empty(0), *(rows.numbers[name] for rows in held)])
        for name in ("seen_m2", "contradicted_m2")
    )
    place = np.searchsorted(codes, code)
    order = np.lexsort((time_order(logs)[log], place))
    contradicted = contradicted[order]
    return Looks(
        place[order],
        log[order],
        contradicted >= AGAINST_M2,
        seen[order],
        contradicted,
        codes,
    )


def areas(
    now: Snapshot, logs: Counted, found: Gathered, seen: Looks, in_use: InUse
) -> tuple[Area, ...]:
    """All areas, those of maps in use first, then by advice, then by what mapping again would help.

    That is m2 x persistence x hours of robots beside it, the persistence by Laplace's rule of
    succession, (still + 1) / (visits + 2), so that one visit is not a hundred per cent.
    """
    if not len(seen.place):
        return ()
    index, col, row = found.places.split()
    rows_of_codes = np.searchsorted(found.places.code, seen.codes)
    where = np.column_stack([a[rows_of_codes] for a in (index, col, row)])
    part = _together(where, _wrong_now(seen))
    kinds = Kinds(now, logs, found)
    order = np.argsort(part, kind="stable")
    first = starts(part[order])
    by_area = np.split(order, first[1:])
    # Looks by area and log: what one log saw of all places of the area.
    rank = time_order(logs)
    area = part[seen.place]
    by = np.lexsort((rank[seen.log], area))
    begins = np.union1d(starts(area[by]), starts(seen.log[by]))
    sums = np.add.reduceat(
        np.column_stack([seen.seen_m2, seen.contradicted_m2])[by], begins, axis=0
    )
    area, log = area[by][begins], seen.log[by][begins]
    ends = np.searchsorted(area, np.arange(len(by_area) + 1))
    answers = []
    for k, places in enumerate(by_area):
        mine = slice(int(ends[k]), int(ends[k + 1]))
        course = course_of(log[mine], sums[mine])
        if course is None:
            continue
        map_index, cells = int(where[places[0], 0]), where[places, 1:]
        since = logs.ordered & (rank >= rank[course.log[0]])
        answers.append(_area(logs, found, course, map_index, cells, kinds, in_use, since))
    return tuple(sorted(answers, key=_order))


def _wrong_now(seen: Looks) -> Flags:
    """(P,) whether one of the latest looks at each place contradicts the map."""
    last = np.append(starts(seen.place)[1:], len(seen.place))
    wrong = np.zeros(len(last), dtype=bool)
    for back in range(1, LATEST_LOOKS + 1):
        at = np.maximum(last - back, 0)
        is_there = (last - back >= 0) & (seen.place[at] == np.arange(len(last)))
        wrong |= is_there & seen.against[at]
    return wrong


def _together(where: Ints, wrong_now: Flags) -> Ints:
    """(P,) number of the area of each place, places by map, column and row."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    # Places of other maps, and of the other kind, lie far away in a third dimension.
    apart = (2 * where[:, 0] + wrong_now) * 2 * (GAP + 1)
    points = np.column_stack([apart, where[:, 1:]])
    pairs = KDTree(points).query_pairs(GAP, p=np.inf, output_type="ndarray")
    count = len(where)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def _area(
    logs: Counted,
    found: Gathered,
    course: Course,
    map_index: int,
    cells: Ints,
    kinds: Kinds,
    in_use: InUse,
    since: Flags,
) -> Area:
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    near_s, lost_s, by = _beside(found, map_index, low, high, since)
    against = course.log[course.against]
    turned = np.flatnonzero(course.against != course.against[-1])
    run = len(course.against) - 1 - (int(turned[-1]) if len(turned) else -1)
    latest = run if course.against[-1] else -run
    robots = logs.distinct("robot", against)
    recent = course.against[-RECENT:]
    site, version = found.maps[map_index]
    advice, why = advice_on(
        len(against),
        robots,
        logs.distinct("robot", course.looked),
        latest,
        float(recent.mean()),
    )
    days = [day for day in logs.day[against].tolist() if day is not None]
    x_min, y_min, x_max, y_max = (PLACE_M * float(edge) for edge in (*low, *high))
    return Area(
        site=site,
        map_version=version,
        box_m=(x_min, y_min, x_max, y_max),
        m2=course.m2,
        kind=kinds.within(map_index, (x_min, y_min, x_max, y_max)),
        logs=len(against),
        robots=robots,
        first_day=min(days, default=None),
        last_day=max(days, default=None),
        visits=len(course.log) - 1,
        still=len(against) - 1,
        latest=latest,
        near_h=near_s / _S_PER_H,
        lost_near_s=lost_s,
        # Of the lost logs, as the page has it: one that was lost for a moment is none.
        lost_near=int(np.count_nonzero(logs.outcome("lost")[1][by])),
        in_use=in_use.of(site, version),
        advice=advice,
        why=why,
        example=logs.texts["key"][against[-1]],
    )


def _beside(
    found: Gathered, map_index: int, low: Ints, high: Ints, since: Flags
) -> tuple[float, float, Ints]:
    """Time of all robots within `NEAR_M` of a box, s; of logs `since` that lost, and which.

    Who was lost there before the map was wrong was not lost because of it.
    """
    reach = round(NEAR_M / PLACE_M)

    def near(code: Ints) -> Flags:
        _, col, row = split(code)
        across = (col >= low[0] - reach) & (col < high[0] + reach)
        return across & (row >= low[1] - reach) & (row < high[1] + reach)

    rows = of_map(found.places.code, map_index)
    here_s = found.places.added[rows, HERE][near(found.places.code[rows])]
    lost = of_map(found.lost.place, map_index)
    who, lost_s = found.lost.by[lost], found.lost.by_s[lost]
    counts = near(found.lost.place[lost]) & since[who]
    return float(here_s.sum()), float(lost_s[counts].sum()), np.unique(who[counts])


_ADVICES: tuple[Advice, ...] = ("re-map", "watch", "temporary")


def worth(area: Area) -> float:
    """What mapping it again would help: m2 x persistence x hours beside it."""
    return area.m2 * (area.still + 1) / (area.visits + 2) * area.near_h


def _order(area: Area) -> tuple[object, ...]:
    return (
        not area.in_use,
        _ADVICES.index(area.advice),
        -worth(area),
        area.site or "",
        area.map_version,
        area.box_m,
    )
