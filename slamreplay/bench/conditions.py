"""Places and lasers, easy ones and hard ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slamreplay.simulate.halls import random_warehouse, repeated_aisles
from slamreplay.simulate.offices import random_office
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import Lidar
from slamreplay.simulate.worlds import World

#: Name to what makes it hard; any of them goes with any kind.
CONDITIONS = {
    "short_range": "a laser that sees 5 to 8 m",
    "narrow": "a laser that sees 180 deg",
    "coarse_map": "map cells of 10 cm",
    "fine_map": "map cells of 1 or 2 cm",
    "two_lasers": "a laser in front and one behind, no other topic of both",
    "no_odometry": "neither odometry nor its tf",
    "no_tf": "poses on /amcl_pose and odometry on /odom, but no tf of either",
    "crowd": "12 to 24 people and pallets in motion",
    "hall_100": "a hall of 100 m x 100 m",
}
_STRUCTURE = ("racks_removed", "racks_moved", "half_changed", "lost_in_changed")


@dataclass(frozen=True)
class Place:
    """A world, and the distance between its aisles along y where they repeat."""

    world: World
    pitch_m: float | None = None


def world_of(kind: str, rng: np.random.Generator, conditions: tuple[str, ...]) -> Place:
    """Where an incident of a kind happens; racks are moved in warehouses only."""
    if "hall_100" in conditions and kind not in ("identical_aisles", "vague_start"):
        return Place(random_warehouse(rng, (100.0, 100.0)))
    if kind == "identical_aisles":
        return Place(*repeated_aisles(rng))
    if kind == "vague_start":
        return Place(*repeated_aisles(rng, shorter=0))
    if kind in _STRUCTURE or rng.random() < 0.6:
        return Place(random_warehouse(rng))
    return Place(random_office(rng))


def conditioned(story: Scenario, rng: np.random.Generator, conditions: tuple[str, ...]) -> Scenario:
    """The same story with another laser or map, or with topics left out."""
    beams, degrees = ((271, 270.0), (361, 360.0), (241, 240.0))[int(rng.integers(3))]
    reach = float(rng.uniform(10.0, 25.0))
    if "narrow" in conditions:
        beams, degrees = 181, 180.0
    if "two_lasers" in conditions:
        beams, degrees = 271, 270.0
    if "short_range" in conditions:
        reach = float(rng.uniform(5.0, 8.0))
    lidar = Lidar(beams=beams, field_of_view=np.radians(degrees), range_max_m=round(reach, 1))
    story = replace(story, lidar=lidar, rear=lidar if "two_lasers" in conditions else None)
    if "coarse_map" in conditions:
        story = replace(story, map_resolution_m=0.1)
    if "fine_map" in conditions:
        fine = (0.01, 0.02)[int(rng.integers(2))]
        story = replace(story, map_resolution_m=fine, true_resolution_m=0.0125)
    if "hall_100" in conditions:
        story = replace(story, true_resolution_m=0.04)
    missing = {"no_odometry": "odometry", "no_tf": "tf"}
    return replace(story, without=frozenset(missing[c] for c in conditions if c in missing))
