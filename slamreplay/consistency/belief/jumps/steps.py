"""Where a path steps as odometry did not, and which row of the ledger made it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.run import Innovations
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2

#: The source whose rows are the robot's own motion, which is no step of the belief.
MOTION = "odometry"
#: A step by this is worth a word.
WORD_M, WORD_RAD = 0.2, float(np.radians(10.0))
#: A step by this is as large as the error of a lost robot.
GRAVE_M, GRAVE_RAD = 0.5, float(np.radians(20.0))


@dataclass(frozen=True)
class Step:
    """A step of a belief beyond what odometry tells of the robot's motion.

    Attributes:
        before_ns: the last moment before it that has a pose.
        t_ns: when it was over.
        before_xyyaw: (3,) where the belief would be now, had it only been carried on.
        xyyaw: (3,) where it is.
        row: set of the ledger and row in it that moved the belief most meanwhile; None where no
            measurement in the ledger did.
    """

    before_ns: int
    t_ns: int
    before_xyyaw: se2.Array
    xyyaw: se2.Array
    row: tuple[int, int] | None

    @property
    def metres(self) -> float:
        """How far."""
        return float(np.hypot(*(self.xyyaw - self.before_xyyaw)[:2]))

    @property
    def radians(self) -> float:
        """How far it turned, without sign."""
        return float(np.abs(se2.wrap_angle(self.xyyaw[2] - self.before_xyyaw[2])))

    @property
    def size(self) -> float:
        """In units of a grave one."""
        return size_of(self.metres, self.radians)

    @property
    def is_grave(self) -> bool:
        """Whether it is as large as the error of a lost robot."""
        return self.size >= 1.0


def size_of(metres: float, radians: float) -> float:
    """A step in units of a grave one: the larger of its two parts."""
    return max(metres / GRAVE_M, radians / GRAVE_RAD)


def steps_of(
    track: PoseTrack, odometry: PoseTrack | None, ledger: Sequence[Innovations]
) -> tuple[Step, ...]:
    """Steps worth a word, in order of time.

    From row to row of the path, against odometry between the two; a step that only the ledger
    tells of (of a belief whose path was smoothed since) is one as well. Nothing where the log has
    no odometry: a robot that drove looks the same then.

    Args:
        track: (N,) the path.
        odometry: the base in odom.
        ledger: what each measurement did to the belief.
    """
    if odometry is None:
        return ()
    corrections = [one if one.source != MOTION else None for one in ledger]
    driven = odometry.at(track.t_ns).xyyaw
    rows = np.flatnonzero(track.has_pose & np.isfinite(driven).all(axis=1))
    rows = rows[np.append(True, np.diff(track.t_ns[rows]) > 0)] if len(rows) else rows
    carried = se2.compose(track.xyyaw[rows[:-1]], se2.between(driven[rows[:-1]], driven[rows[1:]]))
    off = track.xyyaw[rows[1:]] - carried
    turn = np.abs(se2.wrap_angle(off[:, 2]))
    large = (np.hypot(off[:, 0], off[:, 1]) >= WORD_M) | (turn >= WORD_RAD)
    found = []
    for k in np.flatnonzero(large).tolist():
        before_ns, t_ns = int(track.t_ns[rows[k]]), int(track.t_ns[rows[k + 1]])
        made = _maker(corrections, before_ns, t_ns)
        found.append(Step(before_ns, t_ns, carried[k], track.xyyaw[rows[k + 1]], made))
    found += _told_by_ledger(corrections, found)
    return tuple(sorted(found, key=lambda step: step.t_ns))


def _maker(
    ledger: Sequence[Innovations | None], before_ns: int, t_ns: int
) -> tuple[int, int] | None:
    """The accepted row between two times, the latter included, that moved the belief most."""
    best, most = None, -1.0
    for k, one in enumerate(ledger):
        if one is None:
            continue
        rows = np.flatnonzero(one.accepted & (one.t_ns > before_ns) & (one.t_ns <= t_ns))
        sizes = np.nan_to_num(sizes_of(one.moved[rows]))
        if len(rows) and sizes.max() > most:
            best, most = (k, int(rows[int(np.argmax(sizes))])), float(sizes.max())
    return best


def _told_by_ledger(ledger: Sequence[Innovations | None], found: Sequence[Step]) -> list[Step]:
    """Accepted rows that moved the belief by as much, outside of the steps that were found."""
    low = np.array([step.before_ns for step in found], dtype=np.int64)
    high = np.array([step.t_ns for step in found], dtype=np.int64)
    more = []
    for k, one in enumerate(ledger):
        if one is None:
            continue
        metres, radians = np.hypot(one.moved[:, 0], one.moved[:, 1]), np.abs(one.moved[:, 2])
        large = one.accepted & ((metres >= WORD_M) | (radians >= WORD_RAD))
        for row in np.flatnonzero(large).tolist():
            t_ns = int(one.t_ns[row])
            if not ((low < t_ns) & (t_ns <= high)).any():
                more.append(Step(t_ns, t_ns, np.zeros(3), one.moved[row], (k, row)))
    return more


def sizes_of(moved: se2.Array) -> NDArray[np.float64]:
    """(N,) sizes of movements (N, 3) in units of a grave one; NaN where they are not known."""
    metres = np.hypot(moved[:, 0], moved[:, 1]) / GRAVE_M
    return np.asarray(np.maximum(metres, np.abs(moved[:, 2]) / GRAVE_RAD))
