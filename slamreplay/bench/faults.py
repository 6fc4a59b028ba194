"""What is done in each kind of incident: to what stands there, to sensors and map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slamreplay.bench.structure import boxes_added, half_changed, racks_moved, racks_removed
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.simulate.drive import Motion
from slamreplay.simulate.halls import random_warehouse
from slamreplay.simulate.offices import random_office
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import WheelErrors
from slamreplay.simulate.worlds import Solid, World


def on_structure(kind: str, story: Scenario, motion: Motion, rng: np.random.Generator) -> Scenario:
    """What stands otherwise than the map says, off the driven way."""
    way = motion.xyyaw[::10, :2]
    changes = {
        "boxes_added": (boxes_added,),
        "racks_removed": (racks_removed,),
        "racks_moved": (racks_moved,),
        "half_changed": (half_changed,),
        "lost_in_changed": ((boxes_added, racks_removed, racks_moved)[int(rng.integers(3))],),
    }
    world = story.mapped
    for change in changes.get(kind, ()):
        world = change(world, way, rng)
    return replace(story, standing=world)


def on_sensing(kind: str, story: Scenario, motion: Motion, rng: np.random.Generator) -> Scenario:
    """Wrong stamps, lost scans, a filter that trusts itself too much, another map in the log."""
    late = float(rng.uniform(0.05, 0.4))
    if kind == "late_stamps":
        on_scans = rng.random() < 0.5
        return replace(
            story,
            scan_late_s=late if on_scans else 0.0,
            odometry_late_s=0.0 if on_scans else late,
        )
    if kind == "dropped_scans":
        starts = rng.uniform(3.0, motion.t_s[-1] - 8.0, size=int(rng.integers(4, 9)))
        bursts = tuple((float(t), float(t + rng.uniform(0.8, 6.0))) for t in sorted(starts))
        return replace(story, no_scans=bursts)
    if kind == "overconfident":
        sign = np.where(rng.random(3) < 0.5, -1.0, 1.0)
        # A worn, unequal pair of wheels, and a filter told of half the noise that wheels have new:
        # its cloud never reaches the place that odometry misses.
        scale, turn_scale, pull = sign * rng.uniform((0.03, 0.04, 0.012), (0.07, 0.1, 0.03))
        told = (0.5 * 0.02) ** 2
        few = int(rng.integers(40, 100))
        amcl = AmclConfig(
            told, told, told, told, max_beams=15, min_particles=few, max_particles=few
        )
        wheels = WheelErrors(float(scale), float(turn_scale), float(pull), 0.03, 0.04)
        return replace(story, amcl=amcl, wheels=wheels)
    if kind == "map_frame":
        turn = float(rng.uniform(-0.5, 0.5)) if rng.random() < 0.5 else 0.0
        far, towards = rng.uniform(0.6, 3.0), rng.uniform(-np.pi, np.pi)
        shift = (float(far * np.cos(towards)), float(far * np.sin(towards)), turn)
        return replace(story, xyyaw_logged_map=shift)
    if kind == "wrong_map":
        return replace(story, logged=_another_map(story.mapped, rng))
    return story


def _another_map(world: World, rng: np.random.Generator) -> World:
    """Another floor, or the same one at a wrong scale."""
    if rng.random() < 0.3:
        factor = float(rng.choice([0.75, 0.8, 1.25, 1.35]))
        x0, y0, x1, y1 = (factor * v for v in world.bounds)
        solids = tuple(
            Solid(s.name, tuple((factor * x, factor * y) for x, y in s.corners))
            for s in world.solids
        )
        return World((x0, y0, x1, y1), solids)
    is_office = any(s.name.startswith("inner") for s in world.solids)
    return random_office(rng) if is_office else random_warehouse(rng)
