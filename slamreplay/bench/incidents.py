"""Incidents from seeds: a random place, a random tour, and one thing that goes wrong.

The same kind, seed and conditions give the same incident. What a kind is called is what was done;
what the log then shows (a filter may recover) is said by `slamreplay.bench.truth` alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slamreplay.bench import faults, tours
from slamreplay.bench.conditions import CONDITIONS, conditioned, world_of
from slamreplay.bench.crowds import crowd
from slamreplay.bench.single_causes import SINGLE_CAUSES, on_pitch, on_single
from slamreplay.errors import UsageError
from slamreplay.simulate.drive import drive
from slamreplay.simulate.recording import Recording, record
from slamreplay.simulate.routes import Floor
from slamreplay.simulate.scenarios import Scenario

#: What can go wrong, healthy ones first.
KINDS: tuple[str, ...] = (
    "healthy",
    "people",
    "wrong_start",
    "wheel_slip",
    "push",
    "kidnapped",
    "identical_aisles",
    "overconfident",
    "late_stamps",
    "dropped_scans",
    "boxes_added",
    "racks_removed",
    "racks_moved",
    "half_changed",
    "lost_in_changed",
    "map_frame",
    "wrong_map",
)
#: All that can be made. New kinds come last: a kind's place in this list is part of its seed.
ALL_KINDS: tuple[str, ...] = (*KINDS, *SINGLE_CAUSES)
#: Logs last this long, s; the robot never comes nearer than that to anything, m.
_SHORTEST_S, _LONGEST_S, _LEAST_CLEAR_M = 58.0, 120.0, 0.27
_ATTEMPTS = 400


@dataclass(frozen=True, eq=False)
class Incident:
    """One simulated log and what was done to it.

    Attributes:
        kind: one of `ALL_KINDS`.
        seed: the seed it was made from.
        recording: everything a log is made of.
        conditions: of `slamreplay.bench.conditions.CONDITIONS`.
    """

    kind: str
    seed: int
    recording: Recording
    conditions: tuple[str, ...] = ()


def incident(kind: str, seed: int, conditions: tuple[str, ...] = ()) -> Incident:
    """Make one.

    Raises:
        UsageError: there is no such kind or condition.
    """
    return Incident(kind, seed, record(story_of(kind, seed, conditions)), conditions)


def story_of(kind: str, seed: int, conditions: tuple[str, ...] = ()) -> Scenario:
    """What is played in an incident.

    Raises:
        UsageError: there is no such kind or condition.
    """
    if kind not in ALL_KINDS:
        raise UsageError(f"there is no kind of incident '{kind}'", hint=", ".join(ALL_KINDS))
    for name in conditions:
        if name not in CONDITIONS:
            raise UsageError(f"there is no condition '{name}'", hint=", ".join(CONDITIONS))
    for attempt in range(_ATTEMPTS):
        rng = np.random.Generator(np.random.PCG64([seed, ALL_KINDS.index(kind), attempt]))
        story = _story(kind, rng, conditions)
        if story is not None:
            return story
    raise AssertionError(f"no {kind} incident of seed {seed} can be driven")


def _story(kind: str, rng: np.random.Generator, conditions: tuple[str, ...]) -> Scenario | None:
    """One try: None where the tour comes too near to something or lasts too long or short."""
    place = world_of(kind, rng, conditions)
    floor = Floor.of(place.world)
    story = tours.on_tour(kind, place, floor, rng)
    if story is None:
        return None
    motion = drive(story.start, story.tour)
    if not _SHORTEST_S <= motion.t_s[-1] <= _LONGEST_S:
        return None
    story = faults.on_structure(kind, story, motion, rng)
    driven = motion.xyyaw[:, :2]
    if Floor.of(story.mapped, story.standing).at(driven).min() < _LEAST_CLEAR_M:
        return None
    story = faults.on_sensing(kind, story, motion, rng)
    story = conditioned(story, rng, conditions)
    many = kind == "people" or "crowd" in conditions
    n = int(rng.integers(12, 25)) if many else int(rng.integers(0, 4))
    people = crowd(floor, motion, n, rng)
    story = replace(story, walkers=people, seed=int(rng.integers(2**31)))
    if kind == "vague_start":
        return on_pitch(story, place.pitch_m or 0.0, rng)
    return on_single(kind, story, motion, rng)
