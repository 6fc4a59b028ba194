"""A scenario played through: everything a log is made of, and the truth beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.simulate import sensors
from slamreplay.simulate.codes import Readings, read_codes
from slamreplay.simulate.drive import Motion, drive
from slamreplay.simulate.localizer import Beliefs, localize
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.worlds import rasterise, redrawn

ODOMETRY_RATE_HZ = 25.0
#: Two lasers do not turn in step: the rear one sweeps somewhat later.
_REAR_FROM_S = 0.137


@dataclass(frozen=True, eq=False)
class Recording:
    """All times are seconds since the start of the log.

    Attributes:
        scenario: what was played.
        map: the map the robot has.
        logged_map: the map in the log; the robot's own but where a scenario says otherwise.
        standing: what beams meet, people apart.
        motion: the truth.
        scans: the lidar; `t_s` is when they were taken, whatever their stamps say.
        rear: the second laser, None where there is none.
        odometry: the wheels.
        gyro: (N, 3) turn rates, one row per sample of the motion.
        force: (N, 3) specific forces.
        beliefs: the localizer, one row per scan.
        readings: codes in the floor, None where there are none.
        start: (3,) the pose it was given.
        seed: of every random number.
    """

    scenario: Scenario
    map: OccupancyGrid
    logged_map: OccupancyGrid
    standing: OccupancyGrid
    motion: Motion
    scans: sensors.Scans
    rear: sensors.Scans | None
    odometry: sensors.Odometry
    gyro: se2.Array
    force: se2.Array
    beliefs: Beliefs
    readings: Readings | None
    start: se2.Array
    seed: int


def record(scenario: Scenario, seed: int | None = None) -> Recording:
    """Play a scenario; `seed` takes the place of its own."""
    seed = scenario.seed if seed is None else seed
    # One stream per sensor, so that another lidar does not change the wheels.
    streams = np.random.SeedSequence(seed).spawn(6)
    lidar_rng, wheel_rng, imu_rng, start_rng = (
        np.random.Generator(np.random.PCG64(s)) for s in streams[:4]
    )
    grid = rasterise(scenario.mapped, scenario.map_resolution_m, as_map=True)
    standing = rasterise(scenario.standing, scenario.true_resolution_m, as_map=False)
    motion = drive(scenario.start, scenario.tour)
    if "laser" in scenario.without:
        scans = sensors.Scans(np.empty(0), np.empty((0, scenario.lidar.beams), dtype=np.float32))
    else:
        scans = sensors.scan(scenario.lidar, standing, scenario.walkers, motion, lidar_rng)
    scans = _seen(scans, scenario)
    rear = None
    if scenario.rear is not None:
        rear = sensors.scan(
            scenario.rear,
            standing,
            scenario.walkers,
            motion,
            lidar_rng,
            sensors.XYYAW_BASE_REAR,
            _REAR_FROM_S,
        )
        rear = _seen(rear, scenario)
    odometry = sensors.wheel_odometry(scenario.wheels, motion, ODOMETRY_RATE_HZ, wheel_rng)
    if scenario.true_odometry_s:
        odometry = sensors.told_truly(odometry, motion, scenario.true_odometry_s)
    gyro, force = sensors.imu(motion, imu_rng)
    clicked = np.array(scenario.believed_start or scenario.start)
    # Nobody clicks exactly; a careful person is within a decimetre and a few degrees.
    clicked = clicked + start_rng.standard_normal(3) * np.array([0.08, 0.08, 0.03])
    filter_seed = int(streams[4].generate_state(1)[0])
    # The filter on board pairs scans and odometry by their stamps, right or wrong.
    late_s = scenario.scan_late_s - scenario.odometry_late_s
    stamped = replace(scans, t_s=scans.t_s + late_s)
    beliefs = localize(
        grid,
        scenario.lidar,
        stamped,
        odometry,
        (clicked, scenario.start_cov),
        filter_seed,
        scenario.amcl,
    )
    readings = None
    if scenario.floor is not None:
        code_rng = np.random.Generator(np.random.PCG64(streams[5]))
        readings = read_codes(scenario.floor, motion, code_rng)
    return Recording(
        scenario,
        grid,
        _logged_map(scenario, grid),
        standing,
        motion,
        scans,
        rear,
        odometry,
        gyro,
        force,
        beliefs,
        readings,
        clicked,
        seed,
    )


def _seen(scans: sensors.Scans, scenario: Scenario) -> sensors.Scans:
    """What is left of the scans after bursts of lost ones."""
    kept = np.ones(len(scans.t_s), dtype=bool)
    for low, high in scenario.no_scans:
        kept &= (scans.t_s < low) | (scans.t_s >= high)
    return sensors.Scans(scans.t_s[kept], scans.ranges[kept])


def _logged_map(scenario: Scenario, grid: OccupancyGrid) -> OccupancyGrid:
    """The map of the log: of another world, or the robot's own drawn in another frame."""
    if scenario.logged is not None:
        grid = rasterise(scenario.logged, scenario.map_resolution_m, as_map=True)
    frame = np.array(scenario.xyyaw_logged_map)
    return redrawn(grid, frame) if frame.any() else grid
