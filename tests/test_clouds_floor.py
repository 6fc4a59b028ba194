"""Where the floor lies, which heights become a scan, and where a lidar looked in vain."""

import numpy as np
import pytest
from layered_lidar import DepthCamera, LayeredLidar, mount
from scipy.ndimage import distance_transform_edt

from slamreplay.ingest.clouds.band import band_for
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.clouds.floor import floor_plane
from slamreplay.ingest.clouds.rays import ray_table
from slamreplay.simulate.worlds import office, rasterise, warehouse

BETWEEN = (-0.7, 0.15)


@pytest.fixture(scope="module")
def hall():
    return rasterise(warehouse(), 0.025, as_map=False)


def standing(xyyaw):
    return lambda t_s: np.broadcast_to(np.array(xyyaw), (len(t_s), 3)).copy()


def seen(lidar, hall, xyyaw=(9.0, 4.6, 0.4), sweeps=2, seed=3):
    """(N, R, C, 3) what a standing robot's lidar sees."""
    at = 0.1 * np.arange(sweeps)
    return lidar.sweeps(hall, standing(xyyaw), at, np.random.default_rng(seed))


def in_base(points, T):
    """(M, 3) points with a return, in the base frame."""
    flat = points.reshape(-1, 3).astype(float)
    return flat[np.isfinite(flat[:, 0])] @ T[:3, :3].T + T[:3, 3]


@pytest.mark.parametrize("xyyaw", [(9.0, 4.6, 0.4), (1.5, 1.3, 0.0), (15.3, 4.6, 2.0)])
@pytest.mark.parametrize("z", [0.3, 0.55, 1.2])
def test_floor_is_found_among_walls_and_ceiling(hall, xyyaw, z):
    lidar = LayeredLidar(T_base_sensor=mount(z=z), sigma_m=0.02)
    points = in_base(seen(lidar, hall, xyyaw), lidar.T_base_sensor)

    plane = floor_plane(points, lidar.T_base_sensor[:3, 3], BETWEEN)

    corners = np.array([[1.0, x, y] for x in (-5.0, 5.0) for y in (-5.0, 5.0)])
    assert np.abs(corners @ plane).max() < 0.05


@pytest.mark.parametrize(("pitch", "roll"), [(2.0, 0.0), (-2.5, 1.0), (0.0, -3.0)])
def test_a_mount_that_is_not_as_tf_says_tilts_the_floor(hall, pitch, roll):
    told = mount()
    real = mount(pitch=np.radians(pitch), roll=np.radians(roll))
    points = in_base(seen(LayeredLidar(T_base_sensor=real, sigma_m=0.02), hall), told)

    plane = floor_plane(points, told[:3, 3], BETWEEN)

    # The floor's points as the wrong transform lays them out.
    T = told @ np.linalg.inv(real)
    on_floor = np.array([[x, y, 0.0] for x in (-3.0, 3.0) for y in (-3.0, 3.0)])
    as_told = on_floor @ T[:3, :3].T + T[:3, 3]
    off = as_told[:, 2] - plane[0] - as_told[:, :2] @ plane[1:]
    assert np.abs(off).max() < 0.04


def test_what_stands_above_the_floor_is_not_taken_for_it():
    """Of a sensor that tf does not place all heights are asked, walls of narrow rooms included."""
    rooms, rng = rasterise(office(), 0.05, as_map=False), np.random.default_rng(0)
    lidar = LayeredLidar(T_base_sensor=mount(z=1.2), sigma_m=0.03)
    clear = distance_transform_edt(~rooms.occupied) * rooms.resolution_m
    rows, columns = clear.shape
    inside = np.zeros_like(clear, dtype=bool)
    inside[20 : rows - 20, 20 : columns - 20] = True
    places = rooms.centre_of(rng.permutation(np.argwhere((clear > 0.5) & inside))[:20])
    wrong = 0
    for x, y in places:
        points = seen(lidar, rooms, (x, y, rng.uniform(-3.0, 3.0))).reshape(-1, 3).astype(float)
        points = points[np.isfinite(points[:, 0])] @ lidar.T_base_sensor[:3, :3].T
        plane = floor_plane(points, np.zeros(3), (-2.0, -0.1))
        wrong += plane is not None and abs(plane[0] + 1.2) > 0.08

    assert wrong <= 1


def test_without_a_floor_none_is_found(hall):
    lidar = LayeredLidar(elevations=np.radians([0.0, 2.0, 4.0]), sigma_m=0.02)
    points = in_base(seen(lidar, hall), lidar.T_base_sensor)

    assert floor_plane(points, lidar.T_base_sensor[:3, 3], BETWEEN) is None
    assert floor_plane(np.empty((0, 3)), np.zeros(3), BETWEEN) is None


def test_a_base_above_the_floor_finds_it_below(hall):
    lidar = LayeredLidar(sigma_m=0.01)
    points = in_base(seen(lidar, hall), lidar.T_base_sensor) - np.array([0.0, 0.0, 0.3])

    plane = floor_plane(points, np.array([0.1, -0.05, 0.25]), BETWEEN)

    assert plane[0] == pytest.approx(-0.3, abs=0.03)


@pytest.mark.parametrize("height", [0.12, 0.3, 0.55, 1.4, 2.3])
def test_the_band_holds_the_sensor_and_keeps_off_the_floor(height):
    band = band_for(height, None)
    far = band.low_at(np.array([0.0, 5.0, 30.0]))

    assert (far >= 0.05 - 1e-9).all()
    assert far[0] < height < band.high_m
    assert far[2] <= max(band.low_m, height - 0.1)


def test_the_band_is_what_the_user_says():
    band = band_for(0.5, (0.3, 0.7))

    assert (band.low_m, band.high_m) == (0.3, 0.7)


def test_the_band_of_a_sensor_nobody_knows_the_height_of():
    band = band_for(float("nan"), None)

    assert (band.low_m, band.high_m) == (0.2, 1.0)


def organised(points):
    n, rows, columns, _ = points.shape
    return Clouds(
        xyz=points.reshape(-1, 3).T.astype(np.float32),
        time=None,
        offsets=np.arange(n + 1) * rows * columns,
        rows=np.full(n, rows),
        frame_id=np.full(n, "lidar", dtype=object),
        t_sensor_ns=np.arange(n),
        t_log_ns=np.arange(n),
        index=np.arange(n),
    )


@pytest.mark.parametrize("rings_first", [True, False])
def test_rays_without_return_are_told_by_their_ring_and_column(hall, rings_first):
    lidar = LayeredLidar(range_max_m=6.0, sigma_m=0.02)
    points = seen(lidar, hall)
    own = lidar.directions
    if not rings_first:
        points, own = points.swapaxes(1, 2), own.swapaxes(0, 1)

    table = ray_table(organised(points)).T

    lost = ~np.isfinite(points[0].reshape(-1, 3)[:, 0])
    known = np.isfinite(table[:, 0])
    assert lost.mean() > 0.1
    assert known[lost].mean() > 0.8
    cosine = np.clip((table[known] * own.reshape(-1, 3)[known]).sum(axis=1), -1.0, 1.0)
    assert np.degrees(np.arccos(cosine)).max() < 0.3


def test_no_rays_of_cameras_heaps_and_clouds_of_changing_size(hall):
    lidar = LayeredLidar()
    points = seen(lidar, hall)
    heap = organised(points.reshape(2, 1, -1, 3))
    uneven = organised(points)
    uneven.offsets[1] -= 16
    quarter = seen(LayeredLidar(azimuths=np.radians(np.arange(45.0, -45.0, -0.4))), hall)

    for clouds in (organised(seen(DepthCamera(), hall)), heap, uneven, organised(quarter)):
        assert ray_table(clouds) is None
