"""What the log itself holds that can make a localizer jump: one event each, in order of time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from slamreplay.audit.tf_steps import odometry_jumps
from slamreplay.bundle.belief import arrival_ns
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.recoveries import kind_of_recovery
from slamreplay.bundle.run import Innovations
from slamreplay.bundle.sightings import KINDS
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.belief.jumps.steps import sizes_of
from slamreplay.geometry.times import NS_PER_S, ns

#: A thing that was not seen for this long is news when it is seen again.
_NEWS_NS = 5 * NS_PER_S


@dataclass(frozen=True)
class Event:
    """Something that can move a localizer.

    Attributes:
        t_ns: when it was told.
        text: what it was, in words.
        until_s: so long after it a jump may be its doing.
        from_s: so long before it, too: pictures of a graph are published at intervals.
        is_given: whether somebody set the pose on purpose.
    """

    t_ns: int
    text: str
    until_s: float
    from_s: float = 0.0
    is_given: bool = False

    def may_have_made(self, before_ns: int, t_ns: int) -> bool:
        """Whether a step between two times can be its doing."""
        low, high = self.t_ns - ns(self.from_s), self.t_ns + ns(self.until_s)
        return low <= t_ns and before_ns <= high

    def near(self, t_ns: int) -> str:
        """The text, and how long before or after a time it was."""
        apart = (self.t_ns - t_ns) / NS_PER_S
        if abs(apart) < 0.05:
            return self.text
        return f"{self.text} {abs(apart):.1f} s {'later' if apart > 0.0 else 'before'}"


def log_events(view: BundleView) -> tuple[Event, ...]:
    """Starts that were given, closures, tags seen anew, relocalizations, maps, odometry's jumps."""
    found = [*_given(view), *_closures(view), *_seen_anew(view), *_relocalized(view), *_maps(view),
             *_odometry(view)]  # fmt: skip
    return tuple(sorted(found, key=lambda event: (event.t_ns, event.text)))


def with_subjects(ledger: Innovations, view: BundleView) -> Innovations:
    """The ledger of a recorded localizer, each event told at the word it may have moved most."""
    about: list[list[str]] = [[] for _ in range(len(ledger.t_ns))]
    size = np.nan_to_num(sizes_of(ledger.moved), nan=-1.0)
    for event in log_events(view):
        low, high = event.t_ns - ns(event.from_s), event.t_ns + ns(event.until_s)
        rows = np.flatnonzero((ledger.t_ns >= low) & (ledger.t_ns <= high))
        if len(rows):
            row = int(rows[int(np.argmax(size[rows]))])
            about[row].append(event.near(int(ledger.t_ns[row])))
    return replace(ledger, about=np.array(["; ".join(texts) for texts in about], dtype=np.str_))


def _given(view: BundleView) -> Iterator[Event]:
    table = view.role("initial_pose")
    if table is not None:
        for t_ns, topic in zip(arrival_ns(view, table["t_log_ns"]), table["topic"], strict=True):
            yield Event(int(t_ns), f"a pose was given to it ({topic})", 1.0, 0.2, is_given=True)


def _closures(view: BundleView) -> Iterator[Event]:
    table = view.table("closures")
    columns = (table[name] for name in ("kind", "from_id", "to_id", "score"))
    for t_ns, kind, one, other, score in zip(table.t_ns, *columns, strict=True):
        ends = f" node {one} -> {'node ' if kind != 'landmark' else ''}{other}" if other else ""
        fit = f", score {score:.2f}" if np.isfinite(score) else ""
        yield Event(int(t_ns), f"{str(kind).replace('_', ' ')}{ends}{fit}", 3.0, 6.0)


def _seen_anew(view: BundleView) -> Iterator[Event]:
    table = view.table("references")
    table = table.take(np.isin(table["kind"].astype(str), KINDS)).sorted_by_time()
    names = np.array([f"{k} {c}" for k, c in zip(table["kind"], table["child_frame_id"],
                                                 strict=True)], dtype=object)  # fmt: skip
    for name in sorted(set(names.tolist())):
        t_ns = table.t_ns[names == name]
        pause = np.diff(t_ns, prepend=view.manifest.start_ns)
        for k in np.flatnonzero(pause >= _NEWS_NS).tolist():
            since = f"{'again after' if k else 'first after'} {pause[k] / NS_PER_S:.0f} s"
            yield Event(int(t_ns[k]), f"{name} was seen {since}", 1.5)


def _relocalized(view: BundleView) -> Iterator[Event]:
    table = view.table("recoveries")
    for t_ns, name in zip(table.t_ns, table["name"], strict=True):
        if kind_of_recovery(str(name)) == "relocalize":
            yield Event(int(t_ns), f"relocalization was asked for ({name})", 5.0, 0.2)


def _maps(view: BundleView) -> Iterator[Event]:
    course = view.map_course
    for before, after in pairwise(course):
        if before.version != after.version:
            yield Event(after.start_ns, f"the map was exchanged ({after.version[-8:]})", 3.0, 0.2)


def _odometry(view: BundleView) -> Iterator[Event]:
    track = odometry_track(view)
    if track is not None:
        found = odometry_jumps(track)
        for t_ns, metres, turn in zip(found.t_ns, found.metres, found.radians, strict=True):
            size = f"{metres:.2f} m, {np.degrees(turn):.0f} deg"
            yield Event(int(t_ns), f"odometry itself jumped by {size}", 1.0, 0.5)
