"""What the filter is told of its sensors: how far they scatter, and what they always get wrong."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import isfinite

from slamreplay.errors import UsageError

#: Attributes that may be negative: they are errors with a sign.
_SIGNED = (
    "range_offset_m",
    "range_falloff",
    "range_axis_rad",
    "bearing_offset_rad",
    "odometry_delay_s",
    "turn_per_metre",
)


@dataclass(frozen=True)
class Noise:
    """Standard deviations and constant errors of odometry and sightings.

    Errors of a sighting that stay from one look at a thing to the next (the print of a marker, the
    distortion of a lens) are no white noise: fifty looks do not average them out. They are
    modelled as first-order Gauss-Markov processes and estimated with the pose: autocorrelated
    measurement noise by state augmentation (Bar-Shalom, Li, Kirubarajan 2001, chapter 8).

    Attributes:
        position_per_metre: of position along each axis after driving 1 m, m; it grows with the
            square root of the distance, as the next two do with distance and turn.
        heading_per_metre: of the heading after driving 1 m, rad.
        heading_per_turn: of the heading after turning by 1 rad, rad.
        range_m: of a range, whatever its length, m.
        range_per_m: of a range, for each metre of it, m; its variance is added to the former's.
        bearing_rad: of a bearing, rad.
        heading_rad: of the heading of a sensed thing, rad.
        stated_ratio: by how much errors exceed the standard deviations that the log states for its
            sightings; where it does, they stand for the four before this.
        lasting_range_per_m: of the lasting error of the ranges to one thing, per metre; 0: none.
        lasting_bearing_rad: of the lasting error of the bearings of one thing, rad; 0: none.
        lasting_s: time constant with which lasting errors change, s.
        gyro_per_root_s: of the integral of a gyroscope after one second, rad (angle random walk),
            beside what the log states of its rates,
        gyro_per_turn: after turning by 1 rad, rad: its scale,
        gyro_clock_s: of its clock against the odometry's, s.
        gyro_bias: of its bias at the start, rad/s,
        gyro_bias_per_root_s: and of what that changes by in one second, rad/s.
        wheel_turn: of the share by which wheels tell every turn too small or too large, where a
            gyroscope can tell it; skid-steered wheels, off by far more, are found out, too.
        mount_m: of where the sensor sits on the base, along each axis, m,
        mount_rad: and of how it is turned, rad. The filter follows the sensor and no sighting
            tells these: they are added to the covariance that it gives out, never fitted. 0 by
            default: whoever measured the mount knows them.
        range_ratio: measured range divided by the true one.
        range_offset_m: metres added to every range.
        range_falloff: share that a range lacks 1 rad beside the axis of the sensor, growing with
            the square of the angle; a camera that tells depth along its axis, and calls it a range,
            has about 0.5, for cos a is about 1 - a^2 / 2.
        range_axis_rad: bearing of that axis in the base, rad.
        bearing_offset_rad: radians added to every bearing.
        odometry_delay_s: how long before the robot moves, on the clock of the sightings, odometry
            says that it does; commanded speeds and late cameras are positive.
        distance_ratio: true distance divided by the odometry's.
        turn_ratio: true turn divided by the odometry's: a wrong wheel base.
        turn_per_metre: turn to the left for each metre driven that odometry does not see, rad:
            wheels of unequal size (Borenstein and Feng 1996, UMBmark, for both).
    """

    position_per_metre: float = 0.03
    heading_per_metre: float = 0.02
    heading_per_turn: float = 0.05
    range_m: float = 0.03
    range_per_m: float = 0.04
    bearing_rad: float = 0.02
    heading_rad: float = 0.1
    stated_ratio: float = 1.0
    lasting_range_per_m: float = 0.0
    lasting_bearing_rad: float = 0.0
    lasting_s: float = 5.0
    gyro_per_root_s: float = 0.001
    gyro_per_turn: float = 0.01
    gyro_clock_s: float = 0.02
    gyro_bias: float = 0.03
    gyro_bias_per_root_s: float = 1e-4
    wheel_turn: float = 0.02
    mount_m: float = 0.0
    mount_rad: float = 0.0
    range_ratio: float = 1.0
    range_offset_m: float = 0.0
    range_falloff: float = 0.0
    range_axis_rad: float = 0.0
    bearing_offset_rad: float = 0.0
    odometry_delay_s: float = 0.0
    distance_ratio: float = 1.0
    turn_ratio: float = 1.0
    turn_per_metre: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not isfinite(value) or (value < 0.0 and item.name not in _SIGNED):
                raise UsageError(f"{item.name} is {value}", where="ekf", hint="not negative")
        for name in ("bearing_rad", "heading_rad", "stated_ratio", "lasting_s"):
            if getattr(self, name) == 0.0:
                raise UsageError(f"{name} is 0", where="ekf", hint="above 0")
        if self.range_m == 0.0 and self.range_per_m == 0.0:
            raise UsageError("range_m and range_per_m are both 0", where="ekf", hint="above 0")
