"""What a fleet's tables answer, as types: `answering.answers(folder)` computes all of them.

The same questions stand as SQL in `queries.sql` of the folder (`queries`), and give the same
numbers there. A log under two names (one `content`) is counted once, and told in `copies`. Texts
may come from logs: they are to be escaped where they are shown. None of a label means that nobody
told it; None of a number that it is not known.

Types only, and long, for whoever draws or checks a page reads them all in one place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.verdict.judgement import State

Dimension = Literal["site", "robot", "software", "map_version", "day"]

#: By what verdicts are counted.
DIMENSIONS: tuple[Dimension, ...] = ("site", "robot", "software", "map_version", "day")

#: Edge of a spot, m: about as far as a robot drives until it knows that it is lost, and a whole
#: number of places. Single places would fill a list of ten with one corner.
SPOT_M = 4.0

#: Beside an area is within this of it, m: an aisle is driven along its racks, not through them.
NEAR_M = 3.0


#: Logs that a software version needs before it is called worse or better: of one log against three
#: Newcombe's interval may lie on one side of 0, and nobody should act on that.
LEAST_LOGS = 5


@dataclass(frozen=True)
class Share:
    """How many of how many, with a 95 % interval.

    Attributes:
        count: of them it is true.
        n: there are.
        low: Wilson's interval for as many independent logs as these are worth: logs of one robot
            are alike.
        high: the same.
    """

    count: int
    n: int
    low: float | None
    high: float | None

    @property
    def value(self) -> float | None:
        """The share, None of nothing."""
        return self.count / self.n if self.n else None


@dataclass(frozen=True)
class Rate:
    """How often per unit of exposure, with a 95 % interval.

    Attributes:
        events: how often.
        exposure: km or h.
        low: Garwood's exact interval of a Poisson count, widened where robots differ by more than
            chance.
        high: the same.
    """

    events: int
    exposure: float
    low: float | None
    high: float | None

    @property
    def value(self) -> float | None:
        """Per unit, None without exposure."""
        return self.events / self.exposure if self.exposure > 0 else None


@dataclass(frozen=True)
class Group:
    """The logs of one robot, site, map version, software version or day, or all of them.

    Attributes:
        name: of the robot, ...; a day as 2026-03-01; None where nobody told it.
        logs: counted ones, those that could not be judged included.
        failed: that could not be read or judged at all.
        states: logs by state of the verdict, every state named.
        robots: distinct ones.
        sites: distinct ones.
        lost: logs in which the robot was lost, of those with a verdict (not insufficient_data, not
            unobservable).
        changed: logs in which the map was changed, of the same.
        gate_failed: logs that the gate failed, of those that it judged.
        judged_h: time that could be judged, h.
        driven_km: by hindsight, km.
        lost_h: time lost, h.
        changed_h: time in a changed map, h.
        lost_per_km: times it became lost.
        lost_per_h: the same by time judged.
        stops: unplanned ones.
        first_day: of its logs, UTC; None where no clock tells.
        last_day: the same.
    """

    name: str | None
    logs: int
    failed: int
    states: Mapping[State, int]
    robots: int
    sites: int
    lost: Share
    changed: Share
    gate_failed: Share
    judged_h: float
    driven_km: float
    lost_h: float
    changed_h: float
    lost_per_km: Rate
    lost_per_h: Rate
    stops: int
    first_day: date | None
    last_day: date | None


@dataclass(frozen=True)
class Cause:
    """One way of failing over all logs, the one that cost the most hours first.

    Attributes:
        kind: a failure kind: the root cause, else the failure mode.
        logs: with it.
        robots: distinct ones.
        sites: distinct ones.
        lost_h: time lost in them, h.
        changed_h: time in a changed map, h.
        stops: unplanned ones.
        replayed: logs in which a replay reproduced it.
        example: key of the log that lost most by it.
    """

    kind: str
    logs: int
    robots: int
    sites: int
    lost_h: float
    changed_h: float
    stops: int
    replayed: int
    example: str


@dataclass(frozen=True)
class Spot:
    """A square of `SPOT_M` of a map in which robots get lost, the worst first.

    Logs that came by are taken as independent: with few robots, look at `robots`. Squares that few
    logs passed are none, so that one visit does not top the list.

    Attributes:
        box_m: x_min, y_min, x_max, y_max in the frame of the map.
        here_s: time of all robots there, by hindsight.
        lost_s: of it, lost.
        entered: times one became lost here.
        lost: logs in which the robot became lost here, of those that came by.
        robots: distinct ones that became lost here.
        example: key of the log that was lost here longest, of those that became lost here.
    """

    site: str | None
    map_version: str
    box_m: tuple[float, float, float, float]
    here_s: float
    lost_s: float
    entered: int
    lost: Share
    robots: int
    example: str


Advice = Literal["re-map", "watch", "temporary"]


@dataclass(frozen=True)
class Area:
    """A connected part of a map that logs contradicted, what should be mapped again first.

    Attributes:
        box_m: x_min, y_min, x_max, y_max in the frame of the map.
        m2: of the map that a log contradicts, median over logs that do.
        kind: appeared, removed, moved or mixed: of the changed regions in it; None without any.
        logs: distinct ones that contradict it.
        robots: distinct ones that contradict it.
        first_day: when the first one did; None where no clock tells.
        last_day: when the last one did.
        visits: logs that looked there since it was first contradicted, without the first.
        still: of them, those that contradict it.
        latest: how many of the latest looks, one after the other, contradict it; negative: how many
            confirm the map again.
        near_h: time of all robots within `NEAR_M` of it, h.
        lost_near_s: time lost there since it was first contradicted, that log included.
        lost_near: logs with the verdict lost in which the robot was so there since then.
        in_use: whether its map still was at the end of what is known of the site.
        advice: re-map: it stays that way, by more than one robot or log; temporary: the map was
            found right again; watch: neither is known yet.
        why: the advice's reason in a sentence.
        example: key of the latest log that contradicts it.
    """

    site: str | None
    map_version: str
    box_m: tuple[float, float, float, float]
    m2: float
    kind: str | None
    logs: int
    robots: int
    first_day: date | None
    last_day: date | None
    visits: int
    still: int
    latest: int
    near_h: float
    lost_near_s: float
    lost_near: int
    in_use: bool
    advice: Advice
    why: str
    example: str

    @property
    def persistence(self) -> float | None:
        """Share of the later looks that still contradict; None before anybody came back."""
        return self.still / self.visits if self.visits else None


@dataclass(frozen=True)
class Pick:
    """A log worth looking at, the first ones first: one of each kind before a second of any.

    Attributes:
        key: of the log.
        log: where it lies.
        report: folder of its report, None of a log that could not be judged.
        site: label.
        robot: label.
        day: of its start.
        state: of the verdict, None of a log that could not be judged.
        kind: what is odd about it: a failure kind, unreadable, gate, doubtful.
        reason: why, in one sentence.
        alike: logs of the same kind at the same site and spot, this one included.
    """

    key: str
    log: str
    report: str | None
    site: str | None
    robot: str | None
    day: date | None
    state: State | None
    kind: str
    reason: str
    alike: int


@dataclass(frozen=True)
class Step:
    """One number before and after a software version, over the sites that had both.

    Attributes:
        before: version; versions are in the order in which they were first seen.
        after: the next one.
        measure: lost, changed, stopped, gate or a failure kind: share of logs.
        was: with the version before.
        now: with the one after.
        low: of the difference now - was, Newcombe's interval from Wilson's; those of all measures
            of which there are enough logs hold together with 95 %. None where a version has no log
            to count.
        high: the same.
        sites: that ran both; nothing is compared over others.
        robots: distinct ones of both.
    """

    before: str
    after: str
    measure: str
    was: Share
    now: Share
    low: float | None
    high: float | None
    sites: int
    robots: int

    @property
    def verdict(self) -> Literal["worse", "better", "not told apart"]:
        """What the interval says of enough logs; every measure is a fault, so more is worse."""
        if min(self.was.n, self.now.n) < LEAST_LOGS:
            return "not told apart"
        if self.low is not None and self.low > 0:
            return "worse"
        return "better" if self.high is not None and self.high < 0 else "not told apart"


@dataclass(frozen=True, eq=False)
class MapPlaces:
    """One map with what all logs say of its places, for a heat map; arrays are (N,), one per place.

    Attributes:
        logs: that ended in it.
        robots: distinct ones.
        first_day: of these logs; None where no clock tells.
        last_day: the same.
        in_use: whether it still was at the end of what is known of the site.
        col: x from col to col + 1 times `schema.PLACE_M`, in the frame of the map.
        row: y likewise.
        here_s: time of all robots there.
        lost_s: of it, lost.
        entered: times one became lost there.
        passed: logs that came by.
        lost_logs: of them, those in which the robot was lost there, however it came to it.
        seen_m2: of the map that beams checked, greatest over logs.
        looks: logs with a verdict, and a clock, that looked there.
        against: of them, those that contradict the map there.
    """

    site: str | None
    map_version: str
    logs: int
    robots: int
    first_day: date | None
    last_day: date | None
    in_use: bool
    col: NDArray[np.int32]
    row: NDArray[np.int32]
    here_s: se2.Array
    lost_s: se2.Array
    entered: NDArray[np.int64]
    passed: NDArray[np.int64]
    lost_logs: NDArray[np.int64]
    seen_m2: se2.Array
    looks: NDArray[np.int64]
    against: NDArray[np.int64]


@dataclass(frozen=True)
class Failure:
    """A log that could not be read or judged; `error` is the line that says why."""

    key: str
    log: str
    site: str | None
    robot: str | None
    error: str


@dataclass(frozen=True)
class Copies:
    """One log under several names or keys; only `counted` counts.

    Attributes:
        content: hash over its files.
        counted: key.
        logs: all names, sorted.
    """

    content: str
    counted: str
    logs: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Answers:
    """All of them.

    Attributes:
        total: over all logs.
        by: the same by each of `DIMENSIONS`, sorted by name, None last.
        causes: top causes.
        spots: where robots get lost.
        areas: which parts of maps need to be mapped again.
        picks: logs worth looking at first.
        steps: what changed from one software version to the next.
        maps: one per site and map version, those in use first, most logs first.
        copies: logs that occur more than once.
        failures: logs that could not be read or judged, sorted by site and name.
        logs: by key, those counted: where each lies and its report's folder (None without one).
        troubles_s: by key, seconds from a log's start until its first interval in which the robot
            was lost or the map changed; logs without one are not in it.
        alike: how many of a robot's logs are worth one independent log, on average: 1 where logs of
            a robot are no more alike than others.
        remarks: one line each on what was left out, damaged parts among it.
    """

    total: Group
    by: Mapping[Dimension, tuple[Group, ...]]
    causes: tuple[Cause, ...]
    spots: tuple[Spot, ...]
    areas: tuple[Area, ...]
    picks: tuple[Pick, ...]
    steps: tuple[Step, ...]
    maps: tuple[MapPlaces, ...]
    copies: tuple[Copies, ...]
    failures: tuple[Failure, ...]
    logs: Mapping[str, tuple[str, str | None]]
    troubles_s: Mapping[str, float]
    alike: float
    remarks: tuple[str, ...]
