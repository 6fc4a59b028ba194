"""Which heights above the floor become a scan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

#: Key of the topics file: from and to which height above the floor, m.
BAND_KEY = "scan_band_m"
#: Where nobody says otherwise: from above thresholds, cables and what is left of the floor, up to
#: tables. A sensor that sits lower or higher is taken in, for a ray inside the band all its way is
#: what proves free space; under what the robot drives through, its sensor passes.
_LOW_M, _HIGH_M = 0.2, 1.0
_BELOW_M, _ABOVE_M, _LOWEST_M = 0.15, 0.1, 0.05
#: With the distance the band's lower limit rises: this is how far off level a robot may stand. It
#: stays so far below the sensor.
_RISE, _BELOW_SENSOR_M = 0.01, 0.1


@dataclass(frozen=True)
class Band:
    """Heights above the floor.

    Attributes:
        low_m: from here, at the sensor.
        high_m: up to here.
        rise: of the lower limit, metres a metre.
        rises_to_m: the lower limit goes no higher.
    """

    low_m: float
    high_m: float
    rise: float
    rises_to_m: float

    def low_at(self, distance_m: np.ndarray) -> np.ndarray:
        """The lower limit at distances from the sensor."""
        return np.minimum(self.low_m + self.rise * distance_m, self.rises_to_m)


def band_for(sensor_height_m: float, given: tuple[float, float] | None) -> Band:
    """The band of a sensor so high above the floor (NaN where that is not known)."""
    is_known = np.isfinite(sensor_height_m)
    if given is not None:
        low, high = given
    elif is_known:
        low = float(np.clip(sensor_height_m - _BELOW_M, _LOWEST_M, _LOW_M))
        high = max(_HIGH_M, sensor_height_m + _ABOVE_M)
    else:
        low, high = _LOW_M, _HIGH_M
    top = sensor_height_m - _BELOW_SENSOR_M if is_known else 0.5 * (low + high)
    return Band(low, high, _RISE, max(low, min(top, 0.5 * (low + high))))


def given_band(overrides: Mapping[str, str]) -> tuple[float, float] | None:
    """What the topics file says, or None."""
    if BAND_KEY not in overrides:
        return None
    low, high = overrides[BAND_KEY].split()
    return float(low), float(high)
