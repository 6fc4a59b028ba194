"""Turns on the spot and short drives backwards after a stop, as navigators do them to get free.

A recovery begins at rest: the navigator has waited for its controller or planner to give up. A
spin ends at rest too, for then it plans anew; a robot that turns to where its path leads drives on.
One that has come to the end of its path turns to the heading it was asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: Slower than this, over `_HALF_NS` to either side, is at rest.
STILL_M_S, STILL_RAD_S = 0.02, 0.05
#: The rest before a manoeuvre, the one after a spin, and how far from it they may end or begin.
BEFORE_NS, AFTER_NS, GAP_NS = NS_PER_S // 2, 3 * NS_PER_S // 10, NS_PER_S // 2
#: A spin begins above the first and lasts while above the second (Nav2's slowest is 0.4 rad/s);
#: it turns at least so far (Nav2's turns by 1.57 rad) and goes no farther than this.
SPIN_ON_RAD_S, SPIN_OFF_RAD_S = 0.2, 0.06
SPIN_RAD, SPIN_MOVES_M = 1.4, 0.15
#: The same for reversing (Nav2's slowest is 0.05 m/s), how far it goes, and how straight.
BACK_ON_M_S, BACK_OFF_M_S = 0.03, 0.01
BACK_M, BACK_TURNS_RAD = (0.05, 0.5), 0.3
#: A robot that has not driven yet has not stopped: it is being started, undocked or set down.
DRIVEN_M = 0.3
#: Samples farther apart than this tell nothing of what was between them.
SILENCE_NS = NS_PER_S
_HALF_NS = NS_PER_S // 5
#: Commands are heeded late; so much of either end of a manoeuvre is not compared with them.
_LATE_NS = 3 * NS_PER_S // 10


@dataclass(frozen=True)
class Manoeuvre:
    """A spin or a backup, from its first motion to the rest after it."""

    kind: str
    start_ns: int
    end_ns: int


def manoeuvres(
    track: PoseTrack, commands: Table | None, at_goal: Callable[[int], bool | None]
) -> tuple[Manoeuvre, ...]:
    """Spins and backups in time order.

    Args:
        track: base in odom.
        commands: velocity commands; a motion that most of them contradict was no behaviour's.
        at_goal: whether the robot was at the end of its plan at a time, None where that is not
            known. Where it surely was not, any rest before a spin is enough.
    """
    track = track.take(track.has_pose)
    track = track.take(np.argsort(track.t_ns, kind="stable"))
    if len(track) < 3:
        return ()
    t, pose = track.t_ns, track.xyyaw
    forward, sideways, turn = _speeds(t, pose)
    heard = np.concatenate([[True], np.diff(t) <= SILENCE_NS])
    planar = np.hypot(forward, sideways)
    still = (planar < STILL_M_S) & (np.abs(turn) < STILL_RAD_S) & heard
    rests = np.array([(t[a], t[b - 1]) for a, b in _runs(still)], dtype=np.int64).reshape(-1, 2)
    steps = np.hypot(*np.diff(pose[:, :2], axis=0).T) * (planar[1:] >= STILL_M_S)
    driven = np.concatenate([[0.0], np.cumsum(steps)]) >= DRIVEN_M
    left, right = (
        _held(rate > SPIN_ON_RAD_S, (rate > SPIN_OFF_RAD_S) & heard) for rate in (turn, -turn)
    )
    backing = _held(forward < -BACK_ON_M_S, (forward < -BACK_OFF_M_S) & heard)
    found = [
        Manoeuvre(kind, int(t[a]), int(t[b - 1]))
        for kind, runs, fits in (("spin", left + right, _is_spin), ("backup", backing, _is_backup))
        for a, b in runs
        if driven[a] and fits(pose[a:b])
    ]
    kept = [
        move
        for move in found
        if _as_commanded(move, commands)
        and (
            _frees(move, rests, at_goal)
            if move.kind == "spin"
            else _follows(rests, move, BEFORE_NS)
        )
    ]
    return tuple(sorted(kept, key=lambda move: move.start_ns))


def _speeds(
    t: NDArray[np.int64], pose: se2.Array
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """(N,) forward and sideways in m/s and turn rate in rad/s, over a window about each sample."""
    low, high = np.maximum(t - _HALF_NS, t[0]), np.minimum(t + _HALF_NS, t[-1])
    step = se2.between(se2.interpolate(t, pose, low), se2.interpolate(t, pose, high))
    span = np.maximum((high - low) / NS_PER_S, 1e-3)
    return step[:, 0] / span, step[:, 1] / span, step[:, 2] / span


def _frees(
    move: Manoeuvre, rests: NDArray[np.int64], at_goal: Callable[[int], bool | None]
) -> bool:
    """Whether a turn on the spot lies between two rests, and not where a path ends."""
    long_enough = rests[:, 1] - rests[:, 0] >= AFTER_NS
    ends_at_rest = (np.abs(rests[:, 0] - move.end_ns) <= GAP_NS) & long_enough
    if not ends_at_rest.any() or not _follows(rests, move, 0):
        return False
    arrived = at_goal(move.start_ns)
    return not arrived and (arrived is False or _follows(rests, move, BEFORE_NS))


def _follows(rests: NDArray[np.int64], move: Manoeuvre, min_ns: int) -> bool:
    """Whether a manoeuvre comes after a rest (K, 2) of at least `min_ns`."""
    long_enough = rests[:, 1] - rests[:, 0] >= min_ns
    return bool((long_enough & (np.abs(rests[:, 1] - move.start_ns) <= GAP_NS)).any())


def _is_spin(pose: se2.Array) -> bool:
    heading = np.unwrap(pose[:, 2])
    away = float(np.hypot(*(pose[:, :2] - pose[0, :2]).T).max())
    return bool(abs(heading[-1] - heading[0]) >= SPIN_RAD and away <= SPIN_MOVES_M)


def _is_backup(pose: se2.Array) -> bool:
    step = se2.between(pose[0], pose[-1])
    low, high = BACK_M
    return bool(low <= -step[0] <= high and abs(step[2]) <= BACK_TURNS_RAD)


def _as_commanded(move: Manoeuvre, commands: Table | None) -> bool:
    """False where most commands during a manoeuvre asked for something else; True without any."""
    if commands is None or not len(commands):
        return True
    low, high = move.start_ns + _LATE_NS, move.end_ns - _LATE_NS
    inside = (commands.t_ns >= low) & (commands.t_ns <= high)
    if not inside.any():
        return True
    forward = commands["linear_velocity_xyz"][inside, 0]
    turn = commands["angular_velocity_xyz"][inside, 2]
    if move.kind == "spin":
        fits = (np.abs(forward) < STILL_M_S) & (np.abs(turn) > SPIN_OFF_RAD_S)
    else:
        fits = forward < -BACK_OFF_M_S
    return bool(fits.mean() >= 0.5)


def _held(on: NDArray[np.bool_], keep: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Index ranges over which `keep` holds, of those in which `on` does at least once."""
    return [(a, b) for a, b in _runs(keep) if on[a:b].any()]


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Index ranges [start, end) over which a mask (N,) is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
