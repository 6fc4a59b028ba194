"""Who used the pose, and when: controller, planner, goals, recoveries; and how regularly.

Only what was done while the robot moved, or was told to, counts: a pose ages without harm while the
robot rests, and most controllers go on sending zeros then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.audit.rates import rate
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times, ns
from slamreplay.verdict.goals import navigations, recoveries
from slamreplay.verdict.latency.clocks import Clocks
from slamreplay.verdict.motion import REST_M_S, REST_RAD_S, asks_for_motion

Name = Literal["controller", "planner", "goals", "recoveries"]

#: A plan or command that is stamped so long before it was recorded was computed in that time.
_COMPUTED_NS = 2 * NS_PER_S
#: A pause this long, or of so many periods, is no cycle of a loop that came late.
_PAUSE_S, _PAUSE_PERIODS = 2.0, 20.0
#: Times that stand for a consumer that was not recorded are spread over its cycle by this: a grid
#: would meet odometry of the same rate always at the same age.
_GOLDEN = 0.618033988749895


@dataclass(frozen=True)
class Budgets:
    """How often planner and controller need a fresh pose; its age may be one cycle."""

    controller_hz: float = 50.0
    planner_hz: float = 10.0

    def hz(self, name: Name) -> float:
        """Of a consumer; goals and recoveries are begun by the planner's cycle."""
        return self.controller_hz if name == "controller" else self.planner_hz


@dataclass(frozen=True)
class Loop:
    """The rhythm of what a consumer sent.

    Attributes:
        period_s: median interval.
        stall_s: longest interval within a stretch of work.
        stall_ns: when that one began.
    """

    period_s: float
    stall_s: float
    stall_ns: int


@dataclass(frozen=True, eq=False)
class Consumer:
    """One user of the pose.

    Attributes:
        name: controller, planner, goals or recoveries.
        topic: where what it made of the pose was recorded, None where nothing was.
        t_ns: (N,) when it used the pose, on the clock of the stamps, sorted.
        budget_hz: the rate it should have.
        loop: its rhythm; None where it came when it came, or was not recorded.
        work_s: median time from its stamp to its message, None where it has no stamps.
    """

    name: Name
    topic: str | None
    t_ns: Times
    budget_hz: float
    loop: Loop | None = None
    work_s: float | None = None

    @property
    def is_recorded(self) -> bool:
        """Whether it is in the log; if not, its times are those it would have had."""
        return self.topic is not None

    @property
    def budget_s(self) -> float:
        """How old its pose may be: one cycle."""
        return 1.0 / self.budget_hz


def consumers(
    view: BundleView, clocks: Clocks, moved: PoseTrack | None, budgets: Budgets
) -> tuple[Consumer, ...]:
    """Controller and planner, and goals and recoveries where there were any.

    A controller or planner that was not recorded is asked for as if it had run at its budget's rate
    while the robot moved.

    Args:
        view: the log.
        clocks: how its log times are read.
        moved: what tells motion, None where nothing does.
        budgets: rates.
    """
    found = []
    command = view.role("command")
    if command is not None and len(command):
        found.append(_controller(command, clocks, budgets))
    plan = view.role("plan")
    if plan is not None and len(plan):
        found.append(_planner(plan, clocks, budgets))
    there = {one.name for one in found}
    names: Sequence[Name] = ("controller", "planner")
    if moved is not None:
        found += [
            Consumer(name, None, moving_times(moved, budgets.hz(name)), budgets.hz(name))
            for name in names
            if name not in there
        ]
    topic = view.manifest.topic_of("recovery") or "recoveries"
    begun: dict[Name, list[int]] = {
        "goals": [span.start_ns for span in navigations(view) or ()],
        "recoveries": [r.t_ns for r in recoveries(view) if not r.inferred],
    }
    for name, t_ns in begun.items():
        at = np.sort(np.array(t_ns, dtype=np.int64))
        found.append(Consumer(name, topic, at, budgets.planner_hz))
    order: Sequence[Name] = (*names, "goals", "recoveries")
    return tuple(sorted((c for c in found if len(c.t_ns)), key=lambda c: order.index(c.name)))


def _controller(table: Table, clocks: Clocks, budgets: Budgets) -> Consumer:
    """Commands that ask for motion, and the one after each: the loop still ran then."""
    table = table.take(np.argsort(table["t_log_ns"], kind="stable"))
    moving = asks_for_motion(table)
    at_work = moving | np.append(False, moving[:-1])
    sent, used, work_s = _used(table, clocks)
    loop = _loop(sent, moving)
    return Consumer("controller", str(table["topic"][0]), np.sort(used[at_work]),
                    budgets.controller_hz, loop, work_s)  # fmt: skip


def _planner(table: Table, clocks: Clocks, budgets: Budgets) -> Consumer:
    table = table.take(np.argsort(table["t_log_ns"], kind="stable"))
    sent, used, work_s = _used(table, clocks)
    loop = _loop(sent, np.ones(len(sent), dtype=bool))
    return Consumer("planner", str(table["topic"][0]), np.sort(used), budgets.planner_hz, loop,
                    work_s)  # fmt: skip


def _used(table: Table, clocks: Clocks) -> tuple[Times, Times, float | None]:
    """When each message was there, when the pose behind it was read, and what lies between.

    A planner stamps its plan when it begins; where there is no such stamp the pose was read at the
    message's arrival at the latest, and its age is told too large by the time it took to compute.
    """
    arrived, stamps = clocks.arrived_ns(table["t_log_ns"]), table["t_sensor_ns"]
    stamped = stamps != NO_STAMP
    took = arrived - np.where(stamped, stamps, 0)
    begun = stamped & (took >= 0) & (took <= _COMPUTED_NS) & (clocks.basis != "arrival")
    work_s = float(np.median(took[begun])) / NS_PER_S if begun.any() else None
    return arrived, np.where(begun, stamps, arrived), work_s


def _loop(sent: Times, at_work: NDArray[np.bool_]) -> Loop | None:
    """The rhythm of messages (N,), of which those at work are followed by a cycle of the loop."""
    step, counts = np.diff(sent) / NS_PER_S, at_work[:-1]
    if not counts.any():
        return None
    pause = max(_PAUSE_S, _PAUSE_PERIODS * float(np.median(step[counts])))
    counts = counts & (step <= pause)
    worked = np.flatnonzero(counts)
    # Laid end to end, so that pauses are no intervals of the rhythm.
    clock = np.concatenate([[0], np.cumsum(np.rint(step[worked] * NS_PER_S))]).astype(np.int64)
    rhythm = rate(clock, 0, int(clock[-1]))
    if rhythm.period_s is None or not rhythm.is_regular:
        return None
    longest = int(worked[np.argmax(step[worked])])
    return Loop(rhythm.period_s, float(step[longest]), int(sent[longest]))


def moving_times(track: PoseTrack, hz: float) -> Times:
    """(N,) times at a rate, over all the log in which a track moves."""
    track = track.take(track.has_pose)
    track = track.take(np.argsort(track.t_ns, kind="stable"))
    if len(track) < 2:
        return np.zeros(0, dtype=np.int64)
    first, last = int(track.t_ns[0]), int(track.t_ns[-1])
    count = int((last - first) / NS_PER_S * hz)
    k = np.arange(count, dtype=np.float64)
    t_ns = first + np.rint((k + (k * _GOLDEN) % 1.0) / hz * NS_PER_S).astype(np.int64)
    half = ns(0.5)
    low, high = np.maximum(t_ns - half, first), np.minimum(t_ns + half, last)
    step = se2.between(
        se2.interpolate(track.t_ns, track.xyyaw, low),
        se2.interpolate(track.t_ns, track.xyyaw, high),
    )
    span = np.maximum((high - low) / NS_PER_S, 1e-3)
    fast = np.hypot(step[:, 0], step[:, 1]) / span >= REST_M_S
    fast |= np.abs(step[:, 2]) / span >= REST_RAD_S
    return np.sort(t_ns[fast])
