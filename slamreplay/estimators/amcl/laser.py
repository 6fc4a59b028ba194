"""The laser as AMCL sees it: the beams it uses of a scan, and how likely one ends where."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.geometry import se2

#: The laser's range where neither it nor the user said one, m.
_REACH_M = 100.0


@dataclass(frozen=True, eq=False)
class Beams:
    """The M beams of a scan that the filter goes by.

    Attributes:
        bearings: (M,) in the laser frame, rad.
        ranges_m: (M,) returns, m.
        xyyaw_base_laser: (3,) where the laser sits on the robot.
        reach_m: the range over which the uniform part of a beam is spread, m.
    """

    bearings: se2.Array
    ranges_m: se2.Array
    xyyaw_base_laser: ArrayLike
    reach_m: float

    def __len__(self) -> int:
        return len(self.bearings)

    @property
    def returned(self) -> Beams:
        """Those that came back; all but for the beam model."""
        some = self.ranges_m < self.reach_m
        if some.all():
            return self
        return replace(self, bearings=self.bearings[some], ranges_m=self.ranges_m[some])

    def thinned(self, most: int) -> Beams:
        """At most so many of them, evenly spaced."""
        some = slice(0, None, max(1, -(-len(self) // most)))
        return replace(self, bearings=self.bearings[some], ranges_m=self.ranges_m[some])

    @cached_property
    def ends(self) -> se2.Array:
        """(2, M) where they end, in the base frame, m."""
        return self.ends_at(self.ranges_m)

    def ends_at(self, ranges_m: se2.Array) -> se2.Array:
        """(..., 2, M) where they would end with other returns (..., M)."""
        direction = np.column_stack([np.cos(self.bearings), np.sin(self.bearings)])
        ends = se2.transform_points(self.xyyaw_base_laser, ranges_m[..., None] * direction)
        return np.ascontiguousarray(np.swapaxes(ends, -1, -2))


def used_beams(
    config: AmclConfig,
    bearings: ArrayLike,
    ranges_m: ArrayLike,
    usable: ArrayLike,
    xyyaw_base_laser: ArrayLike,
    range_max_m: float,
    missed: ArrayLike = False,
) -> Beams:
    """`max_beams` evenly spaced beams (of B), those without a return inside the range left out.

    The beam model also goes by those that `missed`, as returns from the end of the range; returns
    nearer than `laser_min_range` are such, too.
    """
    limit = config.laser_max_range if config.laser_max_range > 0.0 else np.inf
    reach_m = min(range_max_m if range_max_m > 0.0 else np.inf, limit)
    reach_m = reach_m if np.isfinite(reach_m) else _REACH_M
    bearing = np.asarray(bearings, dtype=np.float64)
    returned = np.asarray(ranges_m, dtype=np.float64)
    spaced = np.zeros(len(bearing), dtype=bool)
    if config.max_beams >= 2:
        spaced[:: max(1, _stride(config, len(bearing)))] = True
    usable = np.asarray(usable, dtype=bool)
    with np.errstate(invalid="ignore"):
        used = spaced & usable & (returned < reach_m)
        near = returned <= config.laser_min_range
    if config.laser_min_range > 0.0:
        used &= ~near
    if config.laser_model_type == "beam":
        ends = spaced & ~used & (usable | np.asarray(missed, dtype=bool))
        used, returned = used | ends, np.where(ends, reach_m, returned)
    return Beams(bearing[used], returned[used], xyyaw_base_laser, reach_m)


def _stride(config: AmclConfig, beams: int) -> int:
    """Every how many beams one is used: nav2_amcl's models do not agree."""
    if config.laser_model_type == "likelihood_field_prob":
        return -(-beams // config.max_beams)
    return (beams - 1) // (config.max_beams - 1)


def likelihood_table(
    config: AmclConfig, distance_m: NDArray[np.float32], reach_m: float
) -> se2.Array:
    """(H + 2, W + 2) likelihood of a beam by the cell it ends in, with a border of what is off map.

    z_hit exp(-d^2 / (2 sigma_hit^2)) + z_rand / reach, d the distance (H, W) to the nearest wall:
    the likelihood field of Thrun, Burgard, Fox: Probabilistic Robotics, table 6.3, its Gaussian
    without a normaliser as in nav2_amcl.
    """
    c = config
    border = c.laser_likelihood_max_dist
    distance = np.pad(distance_m.astype(np.float64), 1, constant_values=border)
    return c.z_hit * np.exp(-(distance**2) / (2.0 * c.sigma_hit**2)) + c.z_rand / reach_m
