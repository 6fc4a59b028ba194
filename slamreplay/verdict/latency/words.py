"""What the localizer and odometry had told, and of which moment each of it speaks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.audit.leads import lead
from slamreplay.audit.streams import Stream
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times
from slamreplay.verdict.latency.clocks import Clocks, usable_stamps

Dated = Literal["scan", "stamp", "arrival"]

#: A correction is of a scan if their stamps agree to this: rounding of floats; in so many of them.
_SAME_NS, _SHARE = 1_000_000, 0.8


@dataclass(frozen=True, eq=False)
class Words:
    """Messages of a localizer (K,), or of odometry, in the order of their arrival.

    Attributes:
        source: topic, or the edge on tf.
        arrived_ns: when each was there.
        until_ns: until when tf can be asked with it: its stamp, dated ahead or not.
        measured_ns: of which moment it speaks, never later than its arrival.
        heard_ns: when the scan it was made from was there; NO_STAMP where that is not known.
        is_new: whether it says something else than the word before.
        dated: what `measured_ns` is: the stamp of a `scan`; the message's own `stamp`, which may
            be when it was published; its `arrival`, where no stamp can be used.
        lead_s: how far it is dated ahead on purpose.
        on_tf: whether it corrects odometry, which then carries the pose on.
    """

    source: str
    arrived_ns: Times
    until_ns: Times
    measured_ns: Times
    heard_ns: Times
    is_new: NDArray[np.bool_]
    dated: Dated
    lead_s: float
    on_tf: bool

    def __len__(self) -> int:
        return len(self.arrived_ns)

    def take(self, rows: NDArray[np.int64]) -> Words:
        """The words at an index array, in that order."""
        names = ("arrived_ns", "until_ns", "measured_ns", "heard_ns", "is_new")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    def latest(self, t_ns: Times) -> NDArray[np.int64]:
        """(N,) the last word that had arrived at times (N,), -1 where there was none."""
        return np.searchsorted(self.arrived_ns, t_ns, side="right") - 1

    def through(self, stage_ns: int) -> Words:
        """The words as they would come through one more stage, which takes one at a time.

        What comes while it works is left out: a stage longer than the words' period also makes
        them fewer.

        Args:
            stage_ns: how long it works on each; 0 changes nothing.
        """
        if stage_ns <= 0 or not len(self):
            return self
        kept, row, arrived = [], 0, self.arrived_ns
        while row < len(arrived):
            kept.append(row)
            row = max(int(np.searchsorted(arrived, arrived[row] + stage_ns)), row + 1)
        rows = np.array(kept, dtype=np.int64)
        # Of a word that is left out the news is in the next one that is not.
        news = np.concatenate([[0], np.cumsum(self.is_new)])
        told = np.diff(np.concatenate([[0], news[rows + 1]])) > 0
        out = self.take(rows)
        return replace(out, arrived_ns=out.arrived_ns + stage_ns, is_new=told)


def corrections(view: BundleView, found: Sequence[Stream], clocks: Clocks) -> Words | None:
    """What the localizer said: map -> odom on tf, else its poses; None where it said nothing.

    A transform that holds at all times is no word: there is nobody who could be late with it.
    """
    frames = view.manifest.frames
    edges = [s for s in found if frames.odom and s.is_edge(frames.map, frames.odom)]
    moving = [s for s in edges if not s.is_static]
    if edges and not moving:
        return None
    if moving:
        edge = max(moving, key=len)
        table = view.recorded("transforms")
        said = [table["translation_xyz"][edge.rows], table["rotation_xyzw"][edge.rows]]
        return _words(view, edge, np.column_stack(said), found, clocks, on_tf=True)
    topic = view.manifest.topic_of("pose")
    poses = [s for s in found if s.table == "poses" and s.topic == topic]
    if not poses:
        return None
    table = view.recorded("poses")
    said = [table["position_xyz"][poses[0].rows], table["orientation_xyzw"][poses[0].rows]]
    return _words(view, poses[0], np.column_stack(said), found, clocks, on_tf=False)


def odometry_words(view: BundleView, found: Sequence[Stream], clocks: Clocks) -> Words | None:
    """When odometry was told, and of which moment: on tf, else on its topic."""
    frames, buffer = view.manifest.frames, view.transforms
    stream: Stream | None = None
    if frames.odom and frames.base and buffer.has_path(frames.odom, frames.base):
        moving = {(e.parent, e.child) for e in buffer.path(frames.odom, frames.base)
                  if not e.is_static}  # fmt: skip
        edges = [s for s in found if s.edge in moving and not s.is_static]
        stream = max(edges, key=len) if edges else None
    if stream is None:
        topic = view.manifest.topic_of("odometry")
        stream = next((s for s in found if s.table == "odometry" and s.topic == topic), None)
    if stream is None or not len(stream):
        return None
    return _words(view, stream, None, [], clocks, on_tf=stream.edge is not None)


def _words(
    view: BundleView,
    stream: Stream,
    said: NDArray[np.float64] | None,
    found: Sequence[Stream],
    clocks: Clocks,
    *,
    on_tf: bool,
) -> Words:
    arrived = clocks.arrived_ns(stream.t_log_ns)
    stamps = clocks.stamped_ns(stream)
    scans = _scans(view, found)
    ahead = lead(stream, view.manifest.clock, scans) if stream.edge is not None else None
    ahead_ns = 0 if ahead is None else round(ahead.seconds * NS_PER_S)
    stamped = stamps != NO_STAMP
    until = np.where(stamped, stamps, arrived)
    measured, heard = until - np.where(stamped, ahead_ns, 0), np.full(len(stream), NO_STAMP)
    dated: Dated = "stamp" if stamped.mean() > _SHARE else "arrival"
    if ahead is not None and ahead.over == "log time":
        measured, dated = arrived, "arrival"
    elif scans is not None and clocks.basis != "arrival":
        of, same = _nearest(usable_stamps(scans), measured)
        if same.mean() >= _SHARE:
            dated = "scan"
            measured = np.where(same, clocks.stamped_ns(scans)[of], measured)
            heard[same] = clocks.arrived_ns(scans.t_log_ns)[of[same]]
    if clocks.basis == "arrival":
        measured, dated = arrived, "arrival"
    is_new = np.ones(len(stream), dtype=bool)
    if said is not None:
        is_new[1:] = (said[1:] != said[:-1]).any(axis=1)
    words = Words(stream.name, arrived, until, np.minimum(measured, arrived), heard, is_new,
                  dated, ahead_ns / NS_PER_S, on_tf)  # fmt: skip
    return words.take(np.argsort(arrived, kind="stable"))


def _scans(view: BundleView, found: Sequence[Stream]) -> Stream | None:
    topic = view.manifest.topic_of("scan")
    return next((s for s in found if s.table == "scans" and s.topic == topic), None)


def _nearest(stamps: Times, t_ns: Times) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """(N,) the row of the scan stamped nearest to each time, and whether it is just that time."""
    order = np.argsort(stamps, kind="stable")
    order = order[stamps[order] != NO_STAMP]
    if not len(order):
        return np.zeros(len(t_ns), dtype=np.int64), np.zeros(len(t_ns), dtype=bool)
    ordered = stamps[order]
    above = np.minimum(np.searchsorted(ordered, t_ns), len(ordered) - 1)
    below = np.maximum(above - 1, 0)
    nearer = np.where(np.abs(ordered[above] - t_ns) < np.abs(ordered[below] - t_ns), above, below)
    return order[nearer], np.abs(ordered[nearer] - t_ns) <= _SAME_NS


def told_streams(view: BundleView) -> list[Stream]:
    """The streams that ages are made of: sensors, tf, poses, plans; nothing that is large."""
    from slamreplay.audit.streams import streams
    from slamreplay.bundle.schema import TABLES

    wanted = ("transforms", "odometry", "imu", "scans", "poses")
    return streams(
        lambda name: view.recorded(name) if name in wanted else Table.empty(TABLES[name])
    )
