"""When each point was taken: a field whose name, unit and zero every driver chooses for itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import NO_STAMP, NS_PER_S
from slamreplay.ingest.clouds.fields import Clouds

_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: A sweep lasts up to so many periods, and no longer than this; and from a thirtieth of a period,
#: or from so little (a throttled topic). The limits lie less than 1000 apart: one unit fits.
_LONGEST, _LONGEST_S = 1.5, 2.0
_SHORTEST, _SHORTEST_S = 1.0 / 30.0, 0.01
#: Later than this a number is a date.
_EPOCH_S = 1e6


@dataclass(frozen=True)
class PointTimes:
    """What recorded times of points mean.

    Attributes:
        unit: "s", "ms", "us" or "ns".
        origin: what they are counted from: the cloud's stamp, the epoch, or nothing that is known:
            then the first point is taken to lie at the stamp.
        period_s: between two clouds, s.
    """

    unit: Literal["s", "ms", "us", "ns"]
    origin: Literal["stamp", "epoch", "first"]
    period_s: float

    def after_stamp_s(self, clouds: Clouds) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """(P,) s from a cloud's stamp to each point, and (N,) the clouds whose times can be.

        NaN where it is not known: in clouds whose times cannot be, and of points without a return
        that drivers leave without a time, too.
        """
        assert clouds.time is not None
        scale, count = _UNITS[self.unit], np.diff(clouds.offsets)
        first, last = _ends(clouds)
        zero: NDArray[Any] = np.zeros(len(clouds))
        if self.origin == "epoch":
            zero = clouds.t_sensor_ns * (1e-9 / scale)
        elif self.origin == "first":
            zero = first
        low, high = ((ends - zero) * scale for ends in (first, last))
        longest = max(_LONGEST * self.period_s, _LONGEST_S)
        with np.errstate(invalid="ignore"):
            sound = (high - low <= longest) & (low >= -longest) & (high <= longest)
            sound &= (clouds.t_sensor_ns != NO_STAMP) | (self.origin != "epoch")
            late = (clouds.time - np.repeat(zero, count)) * scale
            known = np.repeat(sound, count)
            known &= (late >= np.repeat(low, count)) & (late <= np.repeat(high, count))
        known &= np.isfinite(clouds.xyz[0]) | (clouds.time != 0.0)
        return np.where(known, late, np.nan).astype(np.float32), sound


def meaning_of(clouds: Clouds, period_s: float) -> PointTimes | str:
    """What the times in some clouds mean, or why they mean nothing.

    Args:
        clouds: the first ones of a topic.
        period_s: between two of them; NaN where that is not known.
    """
    if clouds.time is None:
        return "its points carry no time"
    first, last = _ends(clouds)
    told = np.isfinite(first)
    if not told.any():
        return "its points carry no time"
    span = float(np.median((last - first)[told]))
    if not span > 0.0:
        return "all points of a cloud carry the same time"
    is_known = period_s > 0.0
    longest = min(_LONGEST * period_s, _LONGEST_S) if is_known else 1.0
    shortest = min(_SHORTEST * period_s, _SHORTEST_S) if is_known else 0.002
    unit = next((u for u, scale in _UNITS.items() if shortest <= span * scale <= longest), None)
    if unit is None:
        period = f"{period_s:.3g} s apart" if is_known else "of unknown rate"
        return f"times of its points span {span:.3g}, which is no sweep of clouds {period}"
    scale = _UNITS[unit]
    begin = float(np.median(first[told])) * scale
    stamped = told & (clouds.t_sensor_ns != NO_STAMP)
    origin: Literal["stamp", "epoch", "first"] = "first"
    if abs(begin) <= max(2.0 * longest, period_s if is_known else 0.0):
        origin = "stamp"
    elif abs(begin) > _EPOCH_S and stamped.any():
        apart = first[stamped] * scale - clouds.t_sensor_ns[stamped] / NS_PER_S
        origin = "epoch" if abs(float(np.median(apart))) <= 2.0 * longest else "first"
    return PointTimes(unit, origin, period_s)  # type: ignore[arg-type]


def _ends(clouds: Clouds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N,) first and last time in each cloud as recorded, of points with a return; else NaN."""
    assert clouds.time is not None
    first = np.full(len(clouds), np.nan)
    last = first.copy()
    filled = np.flatnonzero(np.diff(clouds.offsets) > 0)
    if len(filled):
        time = np.where(np.isfinite(clouds.xyz[0]), clouds.time, np.nan)
        starts = clouds.offsets[filled]
        first[filled] = np.fmin.reduceat(time, starts)
        last[filled] = np.fmax.reduceat(time, starts)
    return first, last
