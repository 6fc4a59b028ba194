"""Latitude and longitude (WGS 84) as metres: earth-centred, and east-north-up about a place."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.geometry.se2 import Array

#: WGS 84: semi-major axis in m, and flattening (NIMA TR8350.2, table 3.1).
_A, _F = 6_378_137.0, 1.0 / 298.257_223_563
_E2 = _F * (2.0 - _F)


def earth_from_geodetic(lat_lon_alt: ArrayLike) -> Array:
    """Positions (..., 3) in REP-105's frame `earth`, m, of latitude, longitude (deg), altitude (m).

    Source: Hofmann-Wellenhof et al., GNSS (2008), equation 8.3.
    """
    place = np.asarray(lat_lon_alt, dtype=np.float64)
    lat, lon = np.radians(place[..., 0]), np.radians(place[..., 1])
    alt = place[..., 2]
    normal = _A / np.sqrt(1.0 - _E2 * np.sin(lat) ** 2)
    level = (normal + alt) * np.cos(lat)
    up = (normal * (1.0 - _E2) + alt) * np.sin(lat)
    return np.stack([level * np.cos(lon), level * np.sin(lon), up], axis=-1)


def enu_axes(latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> Array:
    """R (..., 3, 3) whose rows are east, north and up in the frame `earth`."""
    lat = np.radians(np.asarray(latitude_deg, dtype=np.float64))
    lon = np.radians(np.asarray(longitude_deg, dtype=np.float64))
    zero = np.zeros_like(lat)
    east = np.stack([-np.sin(lon), np.cos(lon), zero], axis=-1)
    north = np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)], axis=-1)
    up = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
    return np.stack([east, north, up], axis=-2)


def enu_axes_at(earth_xyz: ArrayLike) -> Array:
    """R (3, 3) of east, north and up at a position (3,) in `earth`."""
    place = geodetic_from_earth(earth_xyz)
    return enu_axes(place[0], place[1])


def geodetic_from_earth(earth_xyz: ArrayLike) -> Array:
    """Latitude, longitude (deg) and altitude (m) of positions (..., 3) in `earth`.

    The latitude is Bowring's (1976): good to far less than 1e-9 rad near the ground.
    """
    x, y, z = np.moveaxis(np.asarray(earth_xyz, dtype=np.float64), -1, 0)
    level = np.hypot(x, y)
    b = _A * (1.0 - _F)
    angle = np.arctan2(z * _A, level * b)
    second = _E2 / (1.0 - _E2)
    lat = np.arctan2(z + second * b * np.sin(angle) ** 3, level - _E2 * _A * np.cos(angle) ** 3)
    # Along the normal, which is well conditioned at the poles too.
    normal = _A / np.sqrt(1.0 - _E2 * np.sin(lat) ** 2)
    alt = level * np.cos(lat) + z * np.sin(lat) - normal * (1.0 - _E2 * np.sin(lat) ** 2)
    return np.stack([np.degrees(lat), np.degrees(np.arctan2(y, x)), alt], axis=-1)
