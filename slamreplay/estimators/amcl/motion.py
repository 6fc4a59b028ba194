"""How a robot drives, by its odometry: nav2_amcl's two motion models and what sets them apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.noise import cos_sin
from slamreplay.geometry import se2

#: Of a shorter step the bearing is not trusted, m (as nav2_amcl).
_LEAST_STEP_M = 0.01
_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Step:
    """A motion and its noise, in what both models have in common.

    A particle turns by `turn` (noise `turn_sigma`), drives `distance` (`distance_sigma`) along
    where it then looks and none across it (`across_sigma`), and has turned by `total` in all, with
    the noise of the first turn times `total_sigma` and that of the last, `last_sigma`.
    """

    turn: float
    distance: float
    total: float
    turn_sigma: float
    distance_sigma: float
    across_sigma: float
    total_sigma: float
    last_sigma: float

    @property
    def numbers(self) -> se2.Array:
        """(8,) in the order of the attributes."""
        return np.array(list(self.__dict__.values()))


def step_of(config: AmclConfig, old_yaw: float, delta: se2.Array) -> Step:
    """The motion that odometry tells.

    Differential: sample_motion_odometry (Thrun, Burgard, Fox: Probabilistic Robotics, 2005, p.
    136), with the noise of a turn by pi that of none, so that driving backwards is no noisier.
    Omnidirectional: along, across and turning are noisy by themselves (nav2_amcl's
    OmniMotionModel).

    Args:
        config: the filter's.
        old_yaw: heading before, in the odometry frame, rad.
        delta: (3,) what was added to the odometry's x, y and yaw, m and rad.
    """
    c = config
    distance, total = float(np.hypot(delta[0], delta[1])), float(delta[2])
    bearing = float(se2.wrap_angle(np.arctan2(delta[1], delta[0]) - old_yaw))

    def sigma(variance: float) -> float:
        return variance if c.squared_motion_noise else float(np.sqrt(variance))

    if c.motion_model == "omnidirectional":
        along = sigma(c.alpha3 * distance**2 + c.alpha4 * total**2)
        across = sigma(c.alpha5 * distance**2 + c.alpha4 * total**2)
        turning = sigma(c.alpha1 * total**2 + c.alpha2 * distance**2)
        return Step(bearing, distance, total, 0.0, along, across, turning, 0.0)
    first = bearing if distance >= _LEAST_STEP_M else 0.0
    last = float(se2.wrap_angle(total - first))
    size1 = min(abs(first), np.pi - abs(first))
    size2 = min(abs(last), np.pi - abs(last))
    sigma1 = sigma(c.alpha1 * size1**2 + c.alpha2 * distance**2)
    sigma2 = sigma(c.alpha1 * size2**2 + c.alpha2 * distance**2)
    along = sigma(c.alpha3 * distance**2 + c.alpha4 * (size1**2 + size2**2))
    return Step(first, distance, first + last, sigma1, along, 0.0, sigma1, sigma2)


@njit(cache=True, fastmath={"contract", "nsz", "nnan"}, error_model="numpy")
def drive(particles, step, noise):  # type: ignore[no-untyped-def]
    """Move particles (3, N) in place by a step (8,), with standard normal noise (3, N)."""
    turn, distance, total, turn_sigma = step[0], step[1], step[2], step[3]
    distance_sigma, across_sigma, total_sigma, last_sigma = step[4], step[5], step[6], step[7]
    x, y, yaw = particles[0], particles[1], particles[2]
    for i in range(len(x)):
        n0, n1, n2 = noise[0, i], noise[1, i], noise[2, i]
        cos, sin = cos_sin(yaw[i] + turn + turn_sigma * n0)
        along, across = distance + distance_sigma * n1, across_sigma * n2
        x[i] += along * cos + across * sin
        y[i] += along * sin - across * cos
        turned = yaw[i] + total + total_sigma * n0 + last_sigma * n2
        yaw[i] = turned - _TURN * np.floor((turned + np.pi) * (1.0 / _TURN))
