"""WGS 84: the ellipsoid's own equation, its axes, and the way back from earth to east-north-up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.geometry.geodesy import earth_from_geodetic, enu_axes, enu_axes_at

A, B = 6_378_137.0, 6_356_752.314_245

LATITUDES, LONGITUDES = st.floats(-89.9, 89.9), st.floats(-179.9, 179.9)


def test_equator_and_pole():
    equator = earth_from_geodetic([0.0, 90.0, 5.0])
    np.testing.assert_allclose(equator, [0.0, A + 5.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(earth_from_geodetic([90.0, 0.0, 0.0]), [0.0, 0.0, B], atol=1e-6)


@given(LATITUDES, LONGITUDES)
def test_the_ground_lies_on_the_ellipsoid_and_up_is_its_normal(lat, lon):
    x, y, z = earth_from_geodetic([lat, lon, 0.0])
    normal = np.array([x / A**2, y / A**2, z / B**2])

    assert (x * x + y * y) / A**2 + z * z / B**2 == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(enu_axes(lat, lon)[2], normal / np.linalg.norm(normal), atol=1e-12)


@given(LATITUDES, LONGITUDES, st.floats(-100.0, 3000.0))
def test_axes_are_found_again_from_a_place_on_earth(lat, lon, alt):
    at = enu_axes_at(earth_from_geodetic([lat, lon, alt]))

    np.testing.assert_allclose(at, enu_axes(lat, lon), atol=1e-9)
    np.testing.assert_allclose(at @ at.T, np.eye(3), atol=1e-12)


def test_a_step_north_is_a_step_along_north():
    here, there = earth_from_geodetic([[48.0, 11.0, 500.0], [48.0001, 11.0, 500.0]])
    east, north, up = enu_axes_at(here) @ (there - here)

    assert north == pytest.approx(11.12, abs=0.01)  # a ten-thousandth of a degree of latitude
    assert abs(east) < 1e-6
    assert abs(up) < 1e-3
