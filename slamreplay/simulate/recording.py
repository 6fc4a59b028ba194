"""A scenario played through: everything a log is made of, and the truth beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.simulate import sensors
from slamreplay.simulate.drive import Motion, drive
from slamreplay.simulate.localizer import Beliefs, localize
from slamreplay.simulate.scenarios import CLICKED_COV, Scenario
from slamreplay.simulate.worlds import MAP_RESOLUTION_M, TRUE_RESOLUTION_M, rasterise

ODOMETRY_RATE_HZ = 25.0


@dataclass(frozen=True, eq=False)
class Recording:
    """All times are seconds since the start of the log.

    Attributes:
        scenario: what was played.
        map: the map the robot has.
        standing: what beams meet, people apart.
        motion: the truth.
        scans: the lidar.
        odometry: the wheels.
        gyro: (N, 3) turn rates, one row per sample of the motion.
        force: (N, 3) specific forces.
        beliefs: the localizer, one row per scan.
        start: (3,) the pose it was given.
        seed: of every random number.
    """

    scenario: Scenario
    map: OccupancyGrid
    standing: OccupancyGrid
    motion: Motion
    scans: sensors.Scans
    odometry: sensors.Odometry
    gyro: se2.Array
    force: se2.Array
    beliefs: Beliefs
    start: se2.Array
    seed: int


def record(scenario: Scenario, seed: int | None = None) -> Recording:
    """Play a scenario; `seed` takes the place of its own."""
    seed = scenario.seed if seed is None else seed
    # One stream per sensor, so that another lidar does not change the wheels.
    streams = np.random.SeedSequence(seed).spawn(5)
    lidar_rng, wheel_rng, imu_rng, start_rng = (
        np.random.Generator(np.random.PCG64(s)) for s in streams[:4]
    )
    grid = rasterise(scenario.mapped, MAP_RESOLUTION_M, as_map=True)
    standing = rasterise(scenario.standing, TRUE_RESOLUTION_M, as_map=False)
    motion = drive(scenario.start, scenario.tour)
    scans = sensors.scan(scenario.lidar, standing, scenario.walkers, motion, lidar_rng)
    odometry = sensors.wheel_odometry(scenario.wheels, motion, ODOMETRY_RATE_HZ, wheel_rng)
    gyro, force = sensors.imu(motion, imu_rng)
    clicked = np.array(scenario.believed_start or scenario.start)
    # Nobody clicks exactly; a careful person is within a decimetre and a few degrees.
    clicked = clicked + start_rng.standard_normal(3) * np.array([0.08, 0.08, 0.03])
    filter_seed = int(streams[4].generate_state(1)[0])
    beliefs = localize(grid, scenario.lidar, scans, odometry, (clicked, CLICKED_COV), filter_seed)
    return Recording(
        scenario, grid, standing, motion, scans, odometry, gyro, force, beliefs, clicked, seed
    )
