"""How old the pose of one log was: the numbers for the report and for recipes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.audit.streams import Stream
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.verdict.latency.ages import Ages, ages, motion_since
from slamreplay.verdict.latency.clocks import Clocks, clocks_of
from slamreplay.verdict.latency.consumers import Budgets, consumers
from slamreplay.verdict.latency.spread import Spread, share_above, spread
from slamreplay.verdict.latency.words import Words, corrections, odometry_words, told_streams

#: The sensors' own tables, of which the fastest tells how clocks compare.
_SENSORS = ("scans", "odometry", "imu")


@dataclass(frozen=True, eq=False)
class Latency:
    """What a log tells of ages.

    Attributes:
        clocks: what the ages rest on.
        said: the localizer's corrections, None where there are none that could be late.
        odometry: odometry's messages, None without any.
        track: where odometry was, None without any.
        ages: by consumer, in the order of controller, planner, goals, recoveries.
        budgets: the rates that were asked for.
    """

    clocks: Clocks
    said: Words | None
    odometry: Words | None
    track: PoseTrack | None
    ages: tuple[Ages, ...]
    budgets: Budgets

    def unknown_motion(self, of: Ages) -> se2.Array:
        """(N, 3) how the robot moved from the moment of the pose to its use, in its own frame."""
        return motion_since(self.track, of.read_ns, of.consumer.t_ns)


@dataclass(frozen=True, eq=False)
class Usage:
    """One consumer's ages in a few numbers, each over the uses of the pose.

    Attributes:
        ages: all of them.
        correction: age of the localizer's last word.
        update: age of its last new word.
        sensing_s: median time from scan to its arrival, None where that is not known,
        answering_s: from there to the correction,
        waiting_s: and from there to its use.
        pose: age of the pose that was used, after odometry carried it.
        unknown_m: how far the robot moved in that time.
        unknown_rad: by how much it turned.
        over: share of the poses that were older than the budget, and its 95 % interval.
    """

    ages: Ages
    correction: Spread
    update: Spread
    sensing_s: float | None
    answering_s: float | None
    waiting_s: float | None
    pose: Spread
    unknown_m: Spread
    unknown_rad: Spread
    over: tuple[float, float, float] | None


def latency(
    view: BundleView,
    budgets: Budgets = Budgets(),  # noqa: B008 - frozen
    streams: Sequence[Stream] | None = None,
) -> Latency:
    """How old the pose was whenever somebody used it, on the log as it was recorded.

    A word counts from when it was recorded: on the robot it was there a moment sooner or later.

    Args:
        view: the log.
        budgets: rates of controller and planner.
        streams: those of the view, where somebody has them already.
    """
    found = told_streams(view) if streams is None else streams
    manifest = view.manifest
    moving = [s for s in found if s.edge and not s.is_static
              and s.is_edge(manifest.frames.odom, manifest.frames.base)]  # fmt: skip
    sensors = [s for s in found if s.table in _SENSORS] + moving
    clocks = clocks_of(sensors, manifest.clock, simulated=bool(len(view.table("clock"))))
    said, odometry = corrections(view, found, clocks), odometry_words(view, found, clocks)
    track = odometry_track(view)
    track = track if track is not None and len(track) > 1 else None
    users = consumers(view, clocks, track, budgets)
    told = tuple(ages(user, said, odometry) for user in users) if said or odometry else ()
    return Latency(clocks, said, odometry, track, told, budgets)


def usages(of: Latency) -> tuple[Usage, ...]:
    """Each consumer's ages in a few numbers."""
    found = []
    for one in of.ages:
        motion = of.unknown_motion(one)
        found.append(
            Usage(
                one,
                spread(one.correction_s),
                spread(one.update_s),
                spread(one.sensing_s).p50,
                spread(one.answering_s).p50,
                spread(one.waiting_s).p50,
                spread(one.pose_s),
                spread(np.hypot(motion[:, 0], motion[:, 1])),
                spread(np.abs(motion[:, 2])),
                share_above(one.pose_s, one.consumer.budget_s),
            )
        )
    return tuple(found)
