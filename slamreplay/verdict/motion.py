"""When the robot moved, when it was told to, and what its log lines say of safety devices."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: Slower than this over a second is at rest: encoders are silent then, matched scans are not quite.
REST_M_S, REST_RAD_S = 0.05, 0.06
#: A rest this long is a stop; shorter ones are turns and doors.
STOP_NS = 2 * NS_PER_S
#: Commands below this are zeros of a controller that is idle.
COMMAND_M_S, COMMAND_RAD_S = 0.02, 0.05
#: What safety devices, bumpers and their drivers write into the log, and how they take it back.
_PROTECTIVE = re.compile(
    r"protective|emergency|e-?stop\b|safety (stop|field|zone)|bumper|cliff|collision detected|"
    r"collision monitor: stop",
    re.IGNORECASE,
)
_RELEASED = re.compile(r"releas|clear|reset|\bok\b|\binactive\b|\bnot? ", re.IGNORECASE)


@dataclass(frozen=True)
class Span:
    """Times [start_ns, end_ns): at rest after having moved, or with an active goal."""

    start_ns: int
    end_ns: int


def moved_by(view: BundleView, otherwise: PoseTrack | None) -> PoseTrack | None:
    """The track that tells motion: odometry, else another one."""
    track = odometry_track(view)
    return track if track is not None and len(track) > 1 else otherwise


def rests(
    track: PoseTrack, min_ns: int = STOP_NS, *, turning_counts: bool = True
) -> tuple[Span, ...]:
    """Rests of at least `min_ns` that follow a motion.

    Args:
        track: what tells motion.
        min_ns: shorter rests are left out.
        turning_counts: whether turning on the spot is motion; a robot that spins to recover has
            stopped all the same.
    """
    track = track.take(track.has_pose)
    track = track.take(np.argsort(track.t_ns, kind="stable"))
    if len(track) < 2:
        return ()
    half = NS_PER_S // 2
    low, high = track.t_ns - half, track.t_ns + half
    low, high = np.maximum(low, track.t_ns[0]), np.minimum(high, track.t_ns[-1])
    before = se2.interpolate(track.t_ns, track.xyyaw, low)
    step = se2.between(before, se2.interpolate(track.t_ns, track.xyyaw, high))
    span = np.maximum((high - low) / NS_PER_S, 1e-3)
    still = np.hypot(step[:, 0], step[:, 1]) / span < REST_M_S
    if turning_counts:
        still &= np.abs(step[:, 2]) / span < REST_RAD_S
    found = []
    for start, end in runs(still):
        # The window smears a motion by half its length: it ended about that much earlier.
        begin = max(int(track.t_ns[start]) - half, int(track.t_ns[0])) if start else 0
        finish = int(track.t_ns[min(end, len(track) - 1)])
        if start and finish - begin >= min_ns:
            found.append(Span(begin, finish))
    return tuple(found)


def commanded(view: BundleView) -> tuple[NDArray[np.int64], NDArray[np.bool_]] | None:
    """Times (N,) of the commands, sorted, and whether each asked for motion; None without any."""
    table = view.role("command")
    if table is None or not len(table):
        return None
    table = table.sorted_by_time()
    return table.t_ns, asks_for_motion(table)


def asks_for_motion(commands: Table) -> NDArray[np.bool_]:
    """(N,) which rows of a table of commands are more than zeros of a controller that is idle."""
    v = np.linalg.norm(np.nan_to_num(commands["linear_velocity_xyz"]), axis=1)
    w = np.abs(np.nan_to_num(commands["angular_velocity_xyz"][:, 2]))
    return np.asarray((v > COMMAND_M_S) | (w > COMMAND_RAD_S))


def protections(view: BundleView, low_ns: int, high_ns: int) -> str | None:
    """What a safety device said between two times, None where none spoke up."""
    table = view.table("health")
    table = table.take((table.t_ns >= low_ns) & (table.t_ns <= high_ns)).sorted_by_time()
    for message, name in zip(table["message"], table["name"], strict=True):
        if _PROTECTIVE.search(str(message)) and not _RELEASED.search(str(message)):
            return f"{name}: {message}".strip(": ")[:80]
    return None


def word_of_protection(message: str) -> str:
    """The words by which `protections` knows a message of a safety device, "" of any other."""
    found = [pattern.search(message) for pattern in (_PROTECTIVE, _RELEASED)]
    if found[0] is None:
        return ""
    return " ".join(match[0].strip() for match in found if match is not None)


def motion_starts(view: BundleView, otherwise: PoseTrack | None) -> tuple[int, ...]:
    """Times at which a motion was begun after a second or more of none."""
    told = commanded(view)
    if told is not None:
        t_ns, moving = told
        begun = [int(t_ns[start]) for start, _ in runs(moving)]
        ended = [int(t_ns[end - 1]) for _, end in runs(moving)]
        gaps = [NS_PER_S, *(b - a for a, b in zip(ended, begun[1:], strict=False))]
        return tuple(t for t, gap in zip(begun, gaps, strict=True) if gap >= NS_PER_S)
    track = moved_by(view, otherwise)
    if track is None or not len(track):
        return ()
    return tuple(r.end_ns for r in rests(track, NS_PER_S) if r.end_ns < int(track.t_ns.max()))


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Index ranges [start, end) over which a mask (N,) is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]
