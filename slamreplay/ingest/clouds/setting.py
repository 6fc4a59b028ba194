"""What the first clouds of a topic tell about all of them: place, floor, band, density, times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import NO_STAMP, NS_PER_S
from slamreplay.ingest.clouds.band import Band, band_for
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.clouds.floor import floor_plane
from slamreplay.ingest.clouds.place import Place
from slamreplay.ingest.clouds.point_times import PointTimes, meaning_of
from slamreplay.ingest.clouds.rays import ray_table

#: Nearer returns are the robot's own: from the sensor, and from the base's upright axis, m.
RANGE_MIN_M, BODY_M = 0.3, 0.25
#: Angles between beams, rad, and the share of bearings seen that must still fill their beams.
_INCREMENTS, _FILLED = np.radians([0.5, 1.0, 2.0]), 0.8
#: A field of view is closed where less than this is missing, rad; an open one gets a margin, for
#: the beams of a sweep that the robot turned in point elsewhere at its stamp.
_OPEN_RAD, _MARGIN_RAD = np.radians(60.0), np.radians(6.0)
#: With so many points a beam, the nearest few may be flying pixels.
_CROWDED, _SUPPORT = 30.0, 3
#: Lower than this above the floor no sensor sits: the cloud is given in the base's own frame.
_LOWEST_SENSOR_M = 0.05
#: A cloud no thicker than this is a planar laser's: all of it is the scan, and none of it floor.
_FLAT_M, _AROUND_M = 0.1, 0.15
_SAMPLE = 12


@dataclass(frozen=True, eq=False)
class Setting:
    """How a topic's clouds are flattened.

    Attributes:
        place: where the sensor sits.
        floor: (3,) z, dz/dx and dz/dy of the floor in the base frame.
        is_floor_seen: whether the clouds show it.
        sensor_height_m: above the floor; NaN where the cloud does not start at its frame.
        band: heights that become scans.
        angle_min: bearing of the first beam in the level frame, rad.
        increment: between beams, rad.
        beams: of one scan.
        turn: beams that a whole turn would have.
        support: points that a surface needs to count.
        times: what the times of points mean, or why nothing.
        rays: (3, R) directions of the places in an organised cloud, None of others.
    """

    place: Place
    floor: Array
    is_floor_seen: bool
    sensor_height_m: float
    band: Band
    angle_min: float
    increment: float
    beams: int
    turn: int
    support: int
    times: PointTimes | str
    rays: NDArray[np.float32] | None
    range_min_m: float = RANGE_MIN_M
    body_m: float = BODY_M

    @property
    def level_xy(self) -> Array:
        """(2,) where rays start, in the base frame."""
        return self.place.T_base_sensor[:2, 3].copy()


def settle(clouds: Clouds, place: Place, given: tuple[float, float] | None) -> Setting:
    """What the first clouds of a topic tell.

    Args:
        clouds: at least one.
        place: of their sensor.
        given: height band that the user asks for, m.
    """
    sample = _spread(clouds)
    valid = np.flatnonzero(np.isfinite(sample.xyz[0]))
    owner = sample.owner[valid]
    T = place.T_base_sensor
    points = sample.xyz[:, valid].T.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
    low, high = np.quantile(points[:, 2], [0.01, 0.99]) if len(points) else (0.0, 1.0)
    is_flat = high - low <= _FLAT_M
    plane = None if is_flat else floor_plane(points, T[:3, 3], place.ground_between)
    floor = np.array([place.ground_z, 0.0, 0.0]) if plane is None else plane
    height = float(T[2, 3] - floor @ [1.0, *T[:2, 3]])
    is_known = place.is_own_frame and (place.is_on_tf or plane is not None)
    if not (is_known and height > _LOWEST_SENSOR_M):
        height = np.nan
    if is_flat and given is None:
        given = float(low - floor[0] - _AROUND_M), float(high - floor[0] + _AROUND_M)
    band = band_for(height, given)
    from_sensor = points[:, :2] - T[:2, 3]
    distance = np.hypot(*from_sensor.T)
    above = points[:, 2] - floor[0] - points[:, :2] @ floor[1:]
    bearing = np.arctan2(from_sensor[:, 1], from_sensor[:, 0])
    inside = (above >= band.low_at(distance)) & (above <= band.high_m) & (distance >= RANGE_MIN_M)
    increment = _increment(bearing[inside], owner[inside])
    angle_min, beams = _view(bearing, increment)
    filled = _filled(bearing[inside], owner[inside], increment)
    crowd = inside.sum() / max(filled, 1)
    return Setting(
        place=place,
        floor=floor,
        is_floor_seen=plane is not None,
        sensor_height_m=height,
        band=band,
        angle_min=angle_min,
        increment=increment,
        beams=beams,
        turn=round(2.0 * np.pi / increment),
        support=_SUPPORT if crowd > _CROWDED else 1,
        times=meaning_of(clouds, _period_s(clouds)),
        rays=ray_table(sample) if place.is_fixed and np.isfinite(height) else None,
    )


def _spread(clouds: Clouds) -> Clouds:
    """Some of the clouds, from first to last."""
    return clouds.take(
        np.unique(np.linspace(0, len(clouds) - 1, min(_SAMPLE, len(clouds))).astype(int))
    )


def _period_s(clouds: Clouds) -> float:
    """Seconds between clouds, NaN of one alone."""
    stamped = clouds.t_sensor_ns != NO_STAMP
    for t_ns in (clouds.t_sensor_ns[stamped], clouds.t_log_ns):
        apart = np.diff(np.unique(t_ns))
        if len(apart):
            return float(np.median(apart)) / NS_PER_S
    return float("nan")


def _filled(bearing: Array, owner: NDArray[np.int64], increment: float) -> int:
    """Beams with a point in them, of all clouds together."""
    turn = round(2.0 * np.pi / increment)
    beam = np.rint(bearing / increment).astype(np.int64) % turn
    return len(np.unique(owner * turn + beam))


def _increment(bearing: Array, owner: NDArray[np.int64]) -> float:
    """The smallest angle between beams that the points still fill."""
    widest = float(_INCREMENTS[-1])
    seen = _filled(bearing, owner, widest) * widest
    for increment in _INCREMENTS.tolist():
        if _filled(bearing, owner, increment) * increment >= _FILLED * seen:
            return float(increment)
    return widest


def _view(bearing: Array, increment: float) -> tuple[float, int]:
    """Bearing of the first beam and number of beams: a whole turn unless a wide part is missing."""
    turn = round(2.0 * np.pi / increment)
    ordered = np.sort(bearing)
    if len(ordered):
        gaps = np.diff(np.append(ordered, ordered[0] + 2.0 * np.pi))
        widest = int(np.argmax(gaps))
        if gaps[widest] >= _OPEN_RAD:
            begin = ordered[(widest + 1) % len(ordered)] - _MARGIN_RAD
            begin = np.floor(begin / increment) * increment
            wide = 2.0 * np.pi - gaps[widest] + 2.0 * _MARGIN_RAD
            return float(begin), min(int(np.ceil(wide / increment)) + 1, turn)
    return -np.pi, turn
