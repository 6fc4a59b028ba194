"""How old the pose was each time that somebody used it, and what the robot did in that time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times
from slamreplay.verdict.latency.consumers import Consumer
from slamreplay.verdict.latency.words import Words


@dataclass(frozen=True, eq=False)
class Ages:
    """One row for each of N uses of the pose; seconds, NaN where something had not been told yet.

    `correction_s` is `sensing_s + answering_s + waiting_s` where the scan behind it is known.

    Attributes:
        consumer: who used it.
        correction_s: (N,) since the moment of which the localizer's last word speaks. A transform
            that is dated ahead is as old as what it was made from, never of the future.
        update_s: (N,) the same of the last word that said something new: most localizers repeat
            themselves, with fresh stamps, until the robot has moved.
        sensing_s: (N,) from the scan's stamp until the scan was there.
        answering_s: (N,) from there until the correction was there; from the stamp on where the
            scan is not known.
        waiting_s: (N,) from there until it was used.
        pose_s: (N,) since the moment for which the pose was told: of a localizer on tf, odometry
            carries the correction on until the last moment that both transforms reach, which is
            what tf answers when it is asked for the latest pose.
        odometry_s: (N,) since the moment of the last odometry.
        read_ns: (N,) the moment that `pose_s` counts from.
        measured_ns: (N,) the moment that `correction_s` counts from.
        updated_ns: (N,) the moment that `update_s` counts from.
    """

    consumer: Consumer
    correction_s: se2.Array
    update_s: se2.Array
    sensing_s: se2.Array
    answering_s: se2.Array
    waiting_s: se2.Array
    pose_s: se2.Array
    odometry_s: se2.Array
    read_ns: Times
    measured_ns: Times
    updated_ns: Times


def ages(consumer: Consumer, said: Words | None, odometry: Words | None) -> Ages:
    """The ages at a consumer's times.

    Args:
        consumer: who uses the pose, and when.
        said: the localizer's corrections, None where there is none that could be late.
        odometry: odometry's messages, None without any.
    """
    t = consumer.t_ns
    measured, there, heard, until = (_at(said, name, t) for name in _OF_WORDS)
    updated = _at(None if said is None else said.take(np.flatnonzero(said.is_new)),
                  "measured_ns", t)  # fmt: skip
    carried = _newest(odometry, t)
    read = carried
    if said is not None:
        # tf answers for the last moment that both transforms reach.
        both = np.minimum(carried, until)  # NO_STAMP is the least there is
        if odometry is None:
            read = measured
        elif said.on_tf:
            read = both
        else:  # somebody carried it, though tf is not in the log: the belief is read so, too
            read = np.where(measured == NO_STAMP, NO_STAMP, carried)
    sensing, answering = _since(measured, heard), _since(heard, there)
    unknown = heard == NO_STAMP
    answering[unknown] = _since(measured, there)[unknown]
    return Ages(
        consumer,
        correction_s=_since(measured, t),
        update_s=_since(updated, t),
        sensing_s=sensing,
        answering_s=answering,
        waiting_s=_since(there, t),
        pose_s=_since(read, t),
        odometry_s=_since(carried, t),
        read_ns=read,
        measured_ns=measured,
        updated_ns=updated,
    )


_OF_WORDS = ("measured_ns", "arrived_ns", "heard_ns", "until_ns")


def motion_since(track: PoseTrack | None, since_ns: Times, t_ns: Times) -> se2.Array:
    """(N, 3) the robot's motion from moments (N,) to times (N,), in its frame at the moments.

    x is along, y to the left, in m; yaw in rad. NaN where the track does not tell, or there was no
    moment. A motion of no time is none.
    """
    out = np.full((len(t_ns), 3), np.nan)
    asked = since_ns != NO_STAMP
    if track is not None and asked.any():
        end = int(track.t_ns.max())  # the last messages of a log come after the last odometry
        low, high = (np.minimum(t[asked], end) for t in (since_ns, t_ns))
        out[asked] = se2.between(track.at(low).xyyaw, track.at(high).xyyaw)
    return out


def _at(words: Words | None, name: str, t_ns: Times) -> Times:
    """(N,) an attribute of the last word at times (N,), NO_STAMP where there was none."""
    if words is None or not len(words):
        return np.full(len(t_ns), NO_STAMP)
    rows = words.latest(t_ns)
    return np.where(rows >= 0, getattr(words, name)[np.maximum(rows, 0)], NO_STAMP)


def _newest(words: Words | None, t_ns: Times) -> Times:
    """(N,) the newest moment told by times (N,): messages may overtake each other."""
    if words is None or not len(words):
        return np.full(len(t_ns), NO_STAMP)
    rows = words.latest(t_ns)
    newest = np.maximum.accumulate(words.measured_ns)
    return np.where(rows >= 0, newest[np.maximum(rows, 0)], NO_STAMP)


def _since(moment_ns: NDArray[np.int64], t_ns: Times) -> se2.Array:
    """(N,) seconds, NaN where either is unknown."""
    known = (moment_ns != NO_STAMP) & (t_ns != NO_STAMP)
    step = np.where(known, t_ns, 0) - np.where(known, moment_ns, 0)
    return np.where(known, step / NS_PER_S, np.nan)
