"""What the robot senses of its motion and surroundings: lidar, wheel odometry, IMU."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.simulate.drive import Motion
from slamreplay.simulate.people import Walker, ranges_to

#: The laser on the robot: off the middle line and turned a little, as mounts are.
XYYAW_BASE_LASER = np.array([0.21, -0.04, 0.07])
#: A second laser, at the other end of the robot, looks back.
XYYAW_BASE_REAR = np.array([-0.24, 0.05, np.pi - 0.03])
#: Ranges come in steps of 1/1024 m: a millimetre that leaves most bits of a float zero, so that
#: logs compress; IMU and odometry have their own steps for the same reason.
RANGE_STEP_M = 2.0**-10
_GYRO_STEP, _ACCEL_STEP, _POSE_STEP = 2.0**-12, 2.0**-9, 2.0**-20
STANDARD_GRAVITY = 9.80665


@dataclass(frozen=True)
class Lidar:
    """A scanning range finder that sweeps anticlockwise."""

    rate_hz: float = 10.0
    beams: int = 271
    field_of_view: float = np.radians(270.0)
    range_min_m: float = 0.1
    range_max_m: float = 12.0
    sigma_m: float = 0.01
    dropout: float = 0.003

    @property
    def bearings(self) -> se2.Array:
        """(B,) rad in the laser frame."""
        return np.linspace(-0.5, 0.5, self.beams) * self.field_of_view

    @property
    def time_increment_s(self) -> float:
        """Time between two beams of the turning mirror."""
        increment = self.field_of_view / (self.beams - 1)
        return float(increment / (2.0 * np.pi) / self.rate_hz)


@dataclass(frozen=True, eq=False)
class Scans:
    """`ranges` (N, B) float32 m, +inf for no return and 0 for a drop-out; `t_s` of first beams."""

    t_s: se2.Array
    ranges: NDArray[np.float32]


@dataclass(frozen=True)
class WheelErrors:
    """How wheel odometry is wrong: scale errors that stay, and noise that grows with motion.

    Attributes:
        scale: share by which distances are wrong.
        turn_scale: share by which turns are wrong.
        pull: rad of false turn per metre: unequal wheels.
        sigma_m: standard deviation after one metre, m.
        sigma_turn: standard deviation after one radian, rad; after one metre it is a fifth of it.
    """

    scale: float = 0.004
    turn_scale: float = 0.006
    pull: float = 0.0008
    sigma_m: float = 0.01
    sigma_turn: float = 0.02


@dataclass(frozen=True, eq=False)
class Odometry:
    """`xyyaw` (N, 3) in odom, its covariance (N, 3, 3), and `twist` (N, 2), at times `t_s`."""

    t_s: se2.Array
    xyyaw: se2.Array
    cov: se2.Array
    twist: se2.Array


def scan(
    lidar: Lidar,
    standing: OccupancyGrid,
    walkers: tuple[Walker, ...],
    motion: Motion,
    rng: np.random.Generator,
    xyyaw_base_laser: se2.Array = XYYAW_BASE_LASER,
    first_s: float = 0.1,
) -> Scans:
    """All scans of a drive; each beam is cast from where the laser is at its own time."""
    sweep_s = lidar.time_increment_s * (lidar.beams - 1)
    t_s = np.arange(first_s, motion.t_s[-1] - sweep_s, 1.0 / lidar.rate_hz)
    beam_t = (t_s[:, None] + np.arange(lidar.beams) * lidar.time_increment_s).ravel()
    rays = se2.compose(motion.poses_at(beam_t), xyyaw_base_laser)
    rays[:, 2] += np.tile(lidar.bearings, len(t_s))
    ranges = cast_rays(standing, rays, np.zeros(1), lidar.range_max_m)[:, 0]
    ranges = np.minimum(ranges, ranges_to(walkers, beam_t, rays))
    ranges = ranges + lidar.sigma_m * rng.standard_normal(len(ranges))
    ranges = np.rint(ranges / RANGE_STEP_M) * RANGE_STEP_M
    ranges = np.where(ranges > lidar.range_max_m, np.inf, ranges)
    lost = rng.random(len(ranges)) < lidar.dropout
    ranges = np.where(lost | (ranges < lidar.range_min_m), 0.0, ranges)
    return Scans(t_s, ranges.reshape(len(t_s), -1).astype(np.float32))


def wheel_odometry(
    errors: WheelErrors, motion: Motion, rate_hz: float, rng: np.random.Generator
) -> Odometry:
    """Integrated wheel speeds with their errors, and the covariance the driver claims.

    The covariance grows by P' = F P F^T + G Q G^T with the sigmas of `errors`: honest about noise,
    silent about scale errors and slip, as real drivers are.
    """
    dt = np.diff(motion.t_s, prepend=motion.t_s[0] - (motion.t_s[1] - motion.t_s[0]))
    distance, turn = motion.wheels[:, 0] * dt, motion.wheels[:, 1] * dt
    sigma_d = errors.sigma_m * np.sqrt(np.abs(distance))
    var_turn = errors.sigma_turn**2 * (np.abs(turn) + np.abs(distance) / 25.0)
    noise = rng.standard_normal((2, len(dt)))
    distance = distance * (1.0 + errors.scale) + sigma_d * noise[0]
    turn = turn * (1.0 + errors.turn_scale) + errors.pull * distance + np.sqrt(var_turn) * noise[1]
    pose, cov = np.zeros(3), 1e-6 * np.eye(3)
    poses, covs = np.empty((len(dt), 3)), np.empty((len(dt), 3, 3))
    for i in range(len(dt)):
        poses[i], covs[i] = pose, cov
        direction = pose[2] + turn[i] / 2.0
        cos, sin = np.cos(direction), np.sin(direction)
        F = np.array([[1.0, 0.0, -distance[i] * sin], [0.0, 1.0, distance[i] * cos], [0, 0, 1.0]])
        G = np.array([[cos, 0.0], [sin, 0.0], [0.0, 1.0]])
        cov = F @ cov @ F.T + G @ np.diag([sigma_d[i] ** 2, var_turn[i]]) @ G.T
        pose = pose + np.array([distance[i] * cos, distance[i] * sin, turn[i]])
    step = round(1.0 / (rate_hz * dt[0]))
    rows = slice(0, None, step)
    poses[:, 2] = se2.wrap_angle(poses[:, 2])
    poses = np.rint(poses / _POSE_STEP) * _POSE_STEP
    covs = covs.astype(np.float32).astype(np.float64)
    twist = np.column_stack([distance, turn]) / dt[:, None]
    return Odometry(motion.t_s[rows], poses[rows], covs[rows], twist[rows])


def told_truly(
    odometry: Odometry, motion: Motion, stretches: tuple[tuple[float, float], ...]
) -> Odometry:
    """Odometry whose steps inside of stretches (from, to) in s are those that the robot made."""
    true = motion.poses_at(odometry.t_s)
    steps = se2.between(odometry.xyyaw[:-1], odometry.xyyaw[1:])
    steps_made = se2.between(true[:-1], true[1:])
    for low, high in stretches:
        inside = (odometry.t_s[1:] > low) & (odometry.t_s[:-1] < high)
        steps[inside] = steps_made[inside]
    yaw = odometry.xyyaw[0, 2] + np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    along = np.column_stack(
        [cos * steps[:, 0] - sin * steps[:, 1], sin * steps[:, 0] + cos * steps[:, 1]]
    )
    xy = odometry.xyyaw[0, :2] + np.vstack([np.zeros(2), np.cumsum(along, axis=0)])
    return replace(odometry, xyyaw=np.column_stack([xy, se2.wrap_angle(yaw)]))


def imu(motion: Motion, rng: np.random.Generator) -> tuple[se2.Array, se2.Array]:
    """(N, 3) turn rates in rad/s and (N, 3) specific forces in m/s^2, in the base frame."""
    n = len(motion.t_s)
    dt = motion.t_s[1] - motion.t_s[0]
    v, w = motion.twist.T
    gyro = np.zeros((n, 3))
    gyro[:, 2] = w
    gyro += np.array([0.002, -0.001, 0.0015]) + 0.003 * rng.standard_normal((n, 3))
    force = np.column_stack([np.gradient(v, dt), v * w, np.full(n, STANDARD_GRAVITY)])
    force += np.array([0.03, -0.02, 0.05]) + 0.04 * rng.standard_normal((n, 3))
    return np.rint(gyro / _GYRO_STEP) * _GYRO_STEP, np.rint(force / _ACCEL_STEP) * _ACCEL_STEP
