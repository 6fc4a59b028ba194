"""The label of an incident: what it is known to have been caused by.

What was done to a log is known, for we did it; that it is the cause is not, for a filter may
recover from it, and may get lost without it. So every incident has twins: the same story, the same
random numbers, without one of the things done. A thing is a cause of what happened (the robot lost,
or the map contradicted, by the truth alone) if that does not happen in the twin without it: the
but-for test. Where two things were done, each of which does it alone, neither passes that test and
both are causes all the same (Wright, Causation in Tort Law, 1985): a thing that does it in the twin
without all others is one too. Of several causes each is a right answer.

Where the same happens without any of them the cause is not known, and the log counts for nothing.
Where nothing happened there is no incident: the right answer is none. A carry has no twin, for the
robot would be elsewhere: it is the cause where the robot got lost while it was carried or just
after, and was not lost before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from slamreplay.bench.incidents import Incident
from slamreplay.bench.truth import Truth
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.simulate import truth as rules
from slamreplay.simulate.drive import RATE_HZ, Carry, Follow, Motion
from slamreplay.simulate.localizer import odometry_at
from slamreplay.simulate.people import Companion
from slamreplay.simulate.recording import Recording, record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import WheelErrors
from slamreplay.simulate.topics import START_NS
from slamreplay.verdict.judgement import FailureKind

#: A map in another frame, or of elsewhere, is wrong whatever the filter makes of its own one.
_WRONG_MAPS = ("map_frame", "wrong_map")
_CHANGES = ("boxes_added", "racks_removed", "racks_moved", "half_changed", "lost_in_changed")
#: A robot that was put down elsewhere is lost this soon after, s.
_AFTER_S = 5.0


@dataclass(frozen=True)
class Done:
    """One thing that was done to a log.

    Attributes:
        names: of the failure it makes; all of them say the same event, the first one best.
        undone: fields of the scenario in which it was not done.
        acted_s: (from, to) of carries, seconds since the start; empty of all else.
    """

    names: tuple[FailureKind, ...]
    undone: Mapping[str, Any]
    acted_s: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class KnownCause:
    """What a root cause is scored against.

    Attributes:
        happened: lost, map_changed, lost_and_map_changed, wrong_map; none where nothing did.
        accepted: right answers, the first one best; empty where the cause is not known.
        done: names of all that was done, whether it had any effect or not.
    """

    happened: str
    accepted: tuple[FailureKind, ...]
    done: tuple[FailureKind, ...]

    @property
    def is_incident(self) -> bool:
        """Whether something happened that has a known cause."""
        return self.happened != "none" and bool(self.accepted)

    @property
    def label(self) -> str:
        """The row of the confusion matrix: all right answers."""
        if self.happened == "none":
            return "none"
        return " or ".join(self.accepted) or "unknown"


def known_cause(incident: Incident, truth: Truth) -> KnownCause:
    """Label an incident, by its twins where something happened.

    Args:
        incident: what was simulated.
        truth: of its log.
    """
    story, motion = incident.recording.scenario, incident.recording.motion
    done = things_done(incident.kind, story, motion)
    named = _joined(done)
    if incident.kind in _WRONG_MAPS and truth.state in ("healthy", "insufficient_data"):
        return KnownCause("wrong_map", ("wrong_map",), ("wrong_map",))
    if truth.state not in ("lost", "map_changed", "lost_and_map_changed"):
        return KnownCause("none", ("none",), named)
    causes = [
        one
        for one in done
        if (truth.state != "lost" and "standing" in one.undone)
        or (truth.state != "map_changed" and _lost_by(one, done, story, truth))
    ]
    return KnownCause(truth.state, _joined(causes), named)


def _lost_by(one: Done, done: Sequence[Done], story: Scenario, truth: Truth) -> bool:
    """Whether the robot would not have got lost without it, or would have by it alone."""
    if one.acted_s:
        return _lost_within(truth, one.acted_s)
    if not _is_lost(record(replace(story, **one.undone))):
        return True
    others = [other for other in done if other is not one]
    if not others:
        return False
    alone = replace(story, **{k: v for other in others for k, v in other.undone.items()})
    return _is_lost(record(alone))


def _lost_within(truth: Truth, stretches: Sequence[tuple[float, float]]) -> bool:
    """Whether the first loss began in one of the stretches (from, to) in s, or just after."""
    if not truth.lost.any():
        return False
    at_s = float(truth.t_ns[int(np.argmax(truth.lost))] - START_NS) / NS_PER_S
    return any(low <= at_s <= high + _AFTER_S for low, high in stretches)


def things_done(kind: str, story: Scenario, motion: Motion) -> tuple[Done, ...]:
    """Everything that was done to a log, the first that acts first.

    Args:
        kind: of incident.
        story: what is played in it.
        motion: the robot's way through it.
    """
    found: list[Done] = []
    if kind == "vague_start":
        # An honest covariance is no wrong pose: that the aisles look alike is what misleads.
        found.append(Done(("sensing_ambiguity",), {"believed_start": None, "start_sigmas": None}))
    elif story.believed_start is not None:
        # One aisle off is a wrong click that stays unnoticed because the aisles look alike.
        alike: tuple[FailureKind, ...] = ("wrong_initial_pose", "sensing_ambiguity")
        names = alike if kind == "identical_aisles" else alike[:1]
        found.append(Done(names, {"believed_start": None}))
    found += _on_motion(kind, motion)
    found += _on_filter(kind)
    if story.scan_late_s or story.odometry_late_s:
        found.append(Done(("timing",), {"scan_late_s": 0.0, "odometry_late_s": 0.0}))
    if story.no_scans:
        found.append(Done(("timing",), {"no_scans": ()}))
    if kind == "escort":
        alone = tuple(w for w in story.walkers if not isinstance(w, Companion))
        found.append(Done(("association_error",), {"walkers": alone}))
    if kind in _CHANGES:
        found.append(Done(("stale_map_use",), {"standing": story.mapped}))
    return tuple(found)


def _on_motion(kind: str, motion: Motion) -> list[Done]:
    """Slips and carries: without them the robot goes the same way and odometry tells it."""
    carried, slipped = [], []
    for phase in motion.phases:
        first, end = phase.first, phase.last
        if isinstance(phase.step, Carry):
            carried.append((first / RATE_HZ, end / RATE_HZ))
        elif isinstance(phase.step, Follow) and phase.step.slip is not None:
            part = slice(first, end)
            off = np.flatnonzero((motion.twist[part] != motion.wheels[part]).any(axis=1)) + first
            slipped.append((float(off[0]) / RATE_HZ, float(off[-1] + 1) / RATE_HZ))
    found = []
    if carried:
        when = tuple(carried)
        found.append(Done(("kidnapped",), {"true_odometry_s": when}, when))
    if slipped:
        # Somebody who bumps into a robot that drives makes its wheels slip: both names are true.
        names: tuple[FailureKind, ...] = ("odometry_slip",)
        names = ("kidnapped", *names) if kind == "push" else names
        found.append(Done(names, {"true_odometry_s": tuple(slipped)}))
    return found


def _on_filter(kind: str) -> list[Done]:
    ordinary = {"amcl": AmclConfig()}
    if kind == "no_matches":
        return [Done(("optimization_drift",), ordinary)]
    if kind == "too_sure":
        return [Done(("overconfidence",), ordinary)]
    if kind == "overconfident":
        # Two things: worn wheels that an honest filter copes with, and a filter that copes with
        # new ones. The twins tell which of them it took.
        new = {"wheels": WheelErrors()}
        return [Done(("overconfidence",), ordinary), Done(("odometry_slip",), new)]
    return []


def _joined(done: Sequence[Done]) -> tuple[FailureKind, ...]:
    return tuple(dict.fromkeys(name for one in done for name in one.names))


def _is_lost(r: Recording) -> bool:
    """Whether the filter of a recording got lost, by the truth."""
    story = r.scenario
    stamps = r.scans.t_s + story.scan_late_s
    base = odometry_at(r.odometry, stamps - story.odometry_late_s)
    where = r.motion.poses_at(np.minimum(stamps, r.motion.t_s[-1]))
    far = rules.is_far(se2.compose(r.beliefs.map_odom, base), where)
    state = rules.verdict(r.scans.t_s, far, r.scans.t_s, np.zeros(len(far)))
    return state == "lost"
