"""Kinds of incident for causes that the verdict's benchmark has no single one of.

Each does one thing to a story in which nothing else is wrong. The kinds of the verdict's benchmark
stay as they are, to the bit: these are counted after them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.simulate.drive import Motion
from slamreplay.simulate.people import Companion
from slamreplay.simulate.scenarios import Scenario

#: What else can go wrong, one thing at a time.
SINGLE_CAUSES: tuple[str, ...] = (
    "vague_start",
    "escort",
    "no_matches",
    "too_sure",
    "clock_off",
    "scans_stop",
)
#: A vague start lies this far inside of the hall: beside its ends nothing looks alike.
_INNER_M = 4.5


def on_pitch(story: Scenario, pitch_m: float, rng: np.random.Generator) -> Scenario | None:
    """A start that is known to an aisle or so, honestly, in a hall of which all aisles are alike.

    None where it lies at an end of the hall. The laser sees no farther than the aisle.
    """
    x, y, yaw = story.start
    _, low, _, high = story.mapped.bounds
    if min(y - low, high - y) < _INNER_M:
        return None
    told = (x, y + pitch_m * float(rng.standard_normal()), yaw)
    reach = round(float(rng.uniform(3.0, 4.5)), 1)
    return replace(
        story,
        believed_start=told,
        start_sigmas=(0.3, pitch_m, float(np.radians(10.0))),
        lidar=replace(story.lidar, range_max_m=reach),
    )


def on_single(kind: str, story: Scenario, motion: Motion, rng: np.random.Generator) -> Scenario:
    """The story with the one thing done to it."""
    last_s = float(motion.t_s[-1])
    if kind == "escort":
        return replace(story, walkers=(*story.walkers, *_escort(motion, rng)))
    if kind == "no_matches":
        # Metres where the robot's laser was meant: no return is near enough to be matched.
        blind = AmclConfig(laser_max_range=round(float(rng.uniform(0.3, 0.6)), 2))
        return replace(story, amcl=blind)
    if kind == "too_sure":
        # Motion without noise: sixty particles that stay where the first scans put them.
        told = 10.0 ** float(rng.uniform(-7.0, -5.5))
        few = int(rng.integers(40, 80))
        sure = AmclConfig(
            told, told, told, told, max_beams=15, min_particles=few, max_particles=few
        )
        return replace(story, amcl=sure)
    if kind == "clock_off":
        late_s = float(rng.uniform(0.6, 1.2))
        on_scans = rng.random() < 0.5
        return replace(
            story,
            scan_late_s=late_s if on_scans else 0.0,
            odometry_late_s=0.0 if on_scans else late_s,
        )
    if kind == "scans_stop":
        since, lasts = rng.uniform(0.2, 0.4) * last_s, rng.uniform(20.0, 32.0)
        return replace(story, no_scans=((float(since), float(since + lasts)),))
    return story


def _escort(motion: Motion, rng: np.random.Generator) -> tuple[Companion, ...]:
    """People who walk all around the robot for half a minute: hardly a beam gets past them."""
    n, apart = int(rng.integers(10, 14)), float(rng.uniform(0.75, 1.0))
    since = float(rng.uniform(0.2, 0.4) * motion.t_s[-1])
    until = since + float(rng.uniform(20.0, 35.0))
    places = rng.uniform(-np.pi, np.pi) + np.arange(n) * 2.0 * np.pi / n
    return tuple(
        Companion(
            ((0.0, 0.0), (1.0, 0.0)),
            radius_m=0.25,
            t_s=motion.t_s,
            robot_xyyaw=motion.xyyaw,
            beside_m=(float(apart * np.cos(a)), float(apart * np.sin(a))),
            stays_s=(since, until),
        )
        for a in places
    )
